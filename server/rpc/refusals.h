#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>

namespace isomatch {

/// Why a connection was refused.
enum class Refusal { kNoDescriptor, kTooMany, kTooManyOfOrigin };
inline constexpr int kRefusals = 3;

/// Counts refused connections, and logs them so that a flood of them does not
/// fill the log: a warning when they begin, and a line with their number when
/// none was refused for 5 s. Only total() may be called from any thread; the
/// rest belongs to one.
class Refusals {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds kQuiet{5};

  void Add(Refusal why, Clock::time_point now);

  /// Logs how many connections were refused once none was for kQuiet. To be
  /// called every second while is_open().
  void Tell(Clock::time_point now);

  /// Whether there are refusals whose number is still to be logged.
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
