#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>

namespace isomatch {

/// Why a connection was refused.
enum class Refusal { kNoDescriptor, kTooMany, kTooManyOfOrigin };
inline constexpr int kRefusals = 3;

/// Counts and logs refused connections: a warning when they begin, a line with
/// their number when none was refused for 5 s. So a flood of them fills no log.
/// Of one thread, but for total().
class Refusals {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds kQuiet{5};

  void Add(Refusal why, Clock::time_point now);

  /// Logs what is over. To be called every second while is_open().
  void Tell(Clock::time_point now);

  /// Whether something is still to be logged.
  bool is_open() const;

  std::int64_t total() const { return total_; }

 private:
  struct Episode {
    std::int64_t count = 0;
    Clock::time_point last;
  };

  std::array<Episode, kRefusals> episodes_;
  std::atomic<std::int64_t> total_ = 0;
};

}  // namespace isomatch
