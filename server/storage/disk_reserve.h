#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace isomatch {

/// Room on a disk that is given up when the disk is full, so that deleting,
/// which needs a little room first, still works.
///
/// Not thread-safe.
class DiskReserve {
 public:
  /// Takes the room in the file at `path`, if there is as much.
  DiskReserve(const std::string& path, std::int64_t bytes);

  /// Gives it up; false when there is none.
  bool Release();

  /// Takes it again once there is room; looks now and then only.
  void Refill();

 private:
  bool IsThere() const;
  void Take();

  const std::string path_;
  const std::int64_t bytes_;
  std::chrono::steady_clock::time_point next_try_;
};

}  // namespace isomatch
