#pragma once

#include <ostream>
#include <string>

#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "client/progress_line.h"
#include "isomatch/v1/service.pb.h"

namespace isomatch {

/// "first insertion" for STAGE_FIRST_INSERTION.
std::string StageLabel(v1::Stage stage);

/// "queued" for STATE_QUEUED.
std::string StateLabel(v1::Job::State state);

/// What a queued job waits for: "3 ahead", or what keeps the server from
/// starting it.
std::string WaitLabel(const v1::Job& job);

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
