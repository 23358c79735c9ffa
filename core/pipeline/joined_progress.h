#pragma once

#include <tuple>

#include "core/pipeline/progress.h"

namespace isomatch {

/// Makes one series of the reports of Prepare and those of MatchPrepared, which
/// begins with the stages that are over: of these, what does not go beyond the
/// last report is left out. Must outlive both callbacks.
class JoinedProgress {
 public:
  explicit JoinedProgress(const ProgressCallback& progress)
      : progress_(progress) {}

  ProgressCallback OfPreparation() {
    return [this](const Progress& report) {
      last_ = report;
      is_behind_ = true;
      if (progress_) progress_(report);
    };
  }

  ProgressCallback OfMatching() {
    return [this](const Progress& report) {
      is_behind_ = is_behind_ && HowFar(report) <= HowFar(last_);
      if (!is_behind_ && progress_) progress_(report);
    };
  }

 private:
  static std::tuple<double, Stage, double> HowFar(const Progress& report) {
    return {report.total_fraction, report.stage, report.stage_fraction};
  }

  const ProgressCallback& progress_;
  Progress last_ = {};
  bool is_behind_ = false;
};

}  // namespace isomatch
