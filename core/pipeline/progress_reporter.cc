#include "core/pipeline/progress_reporter.h"

#include <algorithm>
#include <cassert>
#include <numeric>

namespace isomatch {

ProgressReporter::ProgressReporter(ProgressCallback callback,
                                   std::vector<std::pair<Stage, double>> plan)
    : callback_(std::move(callback)), plan_(std::move(plan)) {
  for (const auto& [stage, weight] : plan_) total_weight_ += weight;
}

void ProgressReporter::Report(double stage_fraction) {
  stage_fraction_ = stage_fraction;
  const auto& [stage, weight] = plan_[current_];
  const double total =
      (finished_weight_ + weight * stage_fraction) / total_weight_;
  if (callback_) {
    callback_({stage, stage_fraction, std::min(1.0, total), has_map_});
  }
}

void ProgressReporter::Begin(Stage stage) {
  Finish();
  const MutexLock lock(mutex_);
  if (current_ >= 0) finished_weight_ += plan_[current_].second;
  ++current_;
  assert(plan_[current_].first == stage);
  static_cast<void>(stage);
  share_fractions_.clear();
  Report(0);
}

void ProgressReporter::FoundMap() {
  const MutexLock lock(mutex_);
  has_map_ = true;
}

void ProgressReporter::Finish() {
  const MutexLock lock(mutex_);
  if (current_ >= 0) Report(1);
}

std::function<void(double)> ProgressReporter::Share(int share, int shares) {
  return [this, share, shares](double fraction) {
    const MutexLock lock(mutex_);
    share_fractions_.resize(shares, 0);
    share_fractions_[share] = std::max(share_fractions_[share], fraction);
    const double mean =
        std::accumulate(share_fractions_.begin(), share_fractions_.end(), 0.0) /
        shares;
    if (mean > stage_fraction_ && mean < 1) Report(mean);
  };
}

}  // namespace isomatch
