#pragma once

#include <ostream>

#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "client/cli/progress_line.h"
#include "isomatch/v1/service.pb.h"

namespace isomatch {

/// Tells the user how far a job is: fraction, time left, stage. Not
/// thread-safe.
class ProgressDisplay {
 public:
  /// Keeps a reference to `out`.
  ProgressDisplay(std::ostream& out, ProgressStyle style) : line_(out, style) {}

  void Show(const v1::Job& job, absl::Time now = absl::Now());

 private:
  ProgressLine line_;
};

}  // namespace isomatch
