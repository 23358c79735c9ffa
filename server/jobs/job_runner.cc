#include "server/jobs/job_runner.h"

#include <algorithm>
#include <new>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/mesh/mesh_size.h"
#include "core/pipeline/matcher.h"
#include "core/pipeline/memory_estimate.h"
#include "core/pipeline/memory_plan.h"
#include "server/engine/match_with_cache.h"
#include "server/jobs/errors.h"
#include "server/machine/process_memory.h"

namespace isomatch {
namespace {

/// Follows one run: how long each stage takes, how much memory is resident,
/// and which reports are worth passing on.
class RunMeter {
 public:
  RunMeter(const JobRunner::Clock& now,
           const JobRunner::OnProgress& on_progress)
      : now_(now), on_progress_(on_progress), begin_(now()) {
    ResetPeakResidentBytes();
  }

  void OnProgress(const Progress& progress) {
    const absl::Time now = now_();
    const auto stage = static_cast<std::int32_t>(progress.stage);
    const bool is_new = stage != stage_;
    if (is_new) BeginStage(stage, now);
    const bool soon = now - last_report_ < JobRunner::kProgressInterval;
    const bool is_news = is_new || progress.has_map != had_map_;
    if (!is_news && soon && progress.stage_fraction < 1) return;
    last_report_ = now;
    had_map_ = progress.has_map;
    SamplePeak();
    on_progress_({stage, progress.stage_fraction, progress.total_fraction,
                  progress.has_map});
  }

  /// Writes the figures of the whole run. Call once, last.
  void Finish(JobResult& result) {
    BeginStage(kNoStage, now_());
    SamplePeak();
    result.stage_times = std::move(stage_times_);
    result.run_seconds = absl::ToDoubleSeconds(now_() - begin_);
    result.peak_resident_bytes = peak_resident_bytes_;
  }

 private:
  /// Ends the stage before. One that runs again has one time in all.
  void BeginStage(std::int32_t stage, absl::Time now) {
    if (stage_ != kNoStage) {
      const double seconds = absl::ToDoubleSeconds(now - stage_begin_);
      const auto same = std::find_if(
          stage_times_.begin(), stage_times_.end(),
          [&](const StageSeconds& time) { return time.stage == stage_; });
      if (same == stage_times_.end()) {
        stage_times_.push_back({stage_, seconds});
      } else {
        same->seconds += seconds;
      }
    }
    stage_ = stage;
    stage_begin_ = now;
  }

  /// Sampled all along, since another job may reset the peak.
  void SamplePeak() {
    peak_resident_bytes_ = std::max(peak_resident_bytes_, PeakResidentBytes());
  }

  const JobRunner::Clock& now_;
  const JobRunner::OnProgress& on_progress_;
  const absl::Time begin_;
  std::int32_t stage_ = kNoStage;
  bool had_map_ = false;
  absl::Time stage_begin_ = absl::InfinitePast();
  absl::Time last_report_ = absl::InfinitePast();
  std::vector<StageSeconds> stage_times_;
  std::int64_t peak_resident_bytes_ = 0;
};

/// Why a match failed, as calls say it.
absl::Status MatchFailure(const absl::Status& status) {
  if (absl::IsResourceExhausted(status)) return OutOfMemory(status.message());
  if (!absl::IsInvalidArgument(status)) return status;
  const std::string problem(status.message());
  for (const char* field : {"mesh_x", "mesh_y"}) {
    if (absl::StartsWith(problem, field)) return MeshMalformed(field, problem);
  }
  if (!absl::StartsWith(problem, "landmarks")) return status;
  return InvalidField(LeadingFieldPath(problem, "landmarks"), problem);
}

}  // namespace

std::int64_t JobRunner::HeldBytes(const JobSpec& spec, bool with_cache) {
  const std::int64_t extra =
      with_cache ? EstimatePreparedExtraBytes(SizeOf(spec.mesh_x),
                                              SizeOf(spec.mesh_y), spec.options)
                 : 0;
  return MeshBytes(spec) + extra;
}

std::int64_t JobRunner::EstimateBytes(const JobSpec& spec) const {
  return HeldBytes(spec, cache_.capacity_bytes() > 0) +
         engine_.estimate(SizeOf(spec.mesh_x), SizeOf(spec.mesh_y),
                          static_cast<std::int64_t>(spec.landmarks.size()),
                          spec.options);
}

absl::Status JobRunner::PlanMemory(JobSpec& spec) const {
  if (spec.options.memory_limit_bytes == 0) return absl::OkStatus();
  // As with the cache, whether there is one now or not: a job that is loaded
  // again after a restart is to get the same plan.
  ISOMATCH_ASSIGN_OR_RETURN(
      MemoryPlan plan,
      PlanWithinMemory(SizeOf(spec.mesh_x), SizeOf(spec.mesh_y),
                       static_cast<std::int64_t>(spec.landmarks.size()),
                       spec.options, HeldBytes(spec, true)));
  spec.options = std::move(plan.options);
  spec.warnings.insert(spec.warnings.end(), plan.warnings.begin(),
                       plan.warnings.end());
  return absl::OkStatus();
}

void JobRunner::LimitToEstimate(JobSpec& spec) const {
  std::int64_t& limit = spec.options.memory_limit_bytes;
  const std::int64_t estimate = EstimateBytes(spec);
  limit = limit == 0 ? estimate : std::min(limit, estimate);
}

absl::Status JobRunner::ValidateLandmarks(const JobSpec& spec) const {
  return isomatch::ValidateLandmarks(spec.landmarks, spec.mesh_x.num_vertices(),
                                     spec.mesh_y.num_vertices());
}

absl::StatusOr<RunOutcome> JobRunner::Run(const LoadSpec& load,
                                          const OnProgress& on_progress,
                                          const StopTokens& stops) const {
  try {
    RunMeter meter(now_, on_progress);
    ISOMATCH_ASSIGN_OR_RETURN(JobSpec spec, load());
    LimitToEstimate(spec);
    const MeshSize size_x = SizeOf(spec.mesh_x);
    const MeshSize size_y = SizeOf(spec.mesh_y);
    absl::StatusOr<Correspondence> found = MatchWithCache(
        engine_, spec, cache_,
        {[&](const Progress& progress) { meter.OnProgress(progress); },
         stops.stop, stops.hurry});
    if (!found.ok()) return MatchFailure(found.status());
    RunOutcome outcome;
    outcome.parts = EncodeParts(*found);
    outcome.result.info = describe_(spec, size_x, size_y, *found);
    meter.Finish(outcome.result);
    return outcome;
  } catch (const std::bad_alloc&) {
    return OutOfMemory();
  } catch (const std::exception& error) {  // of a library; the server goes on
    return absl::InternalError(absl::StrCat("the match threw: ", error.what()));
  }
}

}  // namespace isomatch
