#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/time/time.h"

namespace isomatch {

inline constexpr double kMebibyte = 1 << 20;

// The same tests run in two lengths: quick, with every build, and soak, with
// ISOMATCH_SOAK=1 in the environment, which scripts/test --soak sets.

bool IsSoak();

/// How many rounds a test does: what the environment says in `variable`, else
/// `soak` or `quick`, of which a tenth under AddressSanitizer.
int Rounds(const char* variable, int quick, int soak);

/// Returns ISOMATCH_SEED, or one that was never used before, and prints it.
std::uint64_t PrintedSeed();

/// Prints a figure, and fails the test when it is above its target. Quick runs
/// share their machine with others: they may take five times the target. Also
/// written to the file ISOMATCH_FIGURES, when there is one.
void ExpectAtMost(const std::string& name, double measured, double target,
                  const std::string& unit);

/// Prints a figure that has no target.
void PrintFigure(const std::string& name, double measured,
                 const std::string& unit);

/// Durations of one kind.
class Latencies {
 public:
  void Add(absl::Duration duration) { durations_.push_back(duration); }
  /// Milliseconds; `fraction` 0.99 is the 99th percentile, 1 the maximum.
  double Milliseconds(double fraction) const;
  int count() const { return static_cast<int>(durations_.size()); }

 private:
  std::vector<absl::Duration> durations_;
};

}  // namespace isomatch
