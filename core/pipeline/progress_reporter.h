#pragma once

#include <functional>
#include <utility>
#include <vector>

#include "core/base/mutex.h"
#include "core/pipeline/progress.h"

namespace isomatch {

/// Turns fractions of single stages into Progress: totals never fall, each
/// stage begins with 0 and ends with 1. Thread-safe.
class ProgressReporter {
 public:
  /// `plan`: the stages that will run, in order, with their share of the work.
  ProgressReporter(ProgressCallback callback,
                   std::vector<std::pair<Stage, double>> plan);

  /// Reports the end of the current stage and the beginning of `stage`.
  void Begin(Stage stage);
  /// Reports from now on that a whole map exists.
  void FoundMap();
  /// Reports the end of the last stage.
  void Finish();

  /// Returns a callback for one of `shares` equal shares that run at the
  /// same time within the current stage.
  std::function<void(double)> Share(int share, int shares);

 private:
  void Report(double stage_fraction);

  const ProgressCallback callback_;
  const std::vector<std::pair<Stage, double>> plan_;
  double total_weight_ = 0;
  Mutex mutex_;
  int current_ = -1;            ///< into plan_
  double finished_weight_ = 0;  ///< of the stages before
  double stage_fraction_ = 0;   ///< reported last
  bool has_map_ = false;
  std::vector<double> share_fractions_;
};

}  // namespace isomatch
