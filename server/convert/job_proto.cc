#include "server/convert/job_proto.h"

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/progress.h"
#include "core/pipeline/verdict.h"
#include "server/convert/job_name.h"
#include "server/jobs/errors.h"

namespace isomatch {
namespace {

// These enums of core, of the records and of the proto count alike.
static_assert(static_cast<int>(Profile::kDefault) + 1 == v1::PROFILE_DEFAULT);
static_assert(static_cast<int>(Profile::kPaper) + 1 == v1::PROFILE_PAPER);
static_assert(static_cast<int>(JobState::kQueued) == v1::Job::STATE_QUEUED);
static_assert(static_cast<int>(JobState::kCancelled) ==
              v1::Job::STATE_CANCELLED);
static_assert(static_cast<int>(WaitReason::kTurn) ==
              v1::Job::WAIT_REASON_UNSPECIFIED);
static_assert(static_cast<int>(WaitReason::kStorage) ==
              v1::Job::WAIT_REASON_STORAGE);
static_assert(static_cast<int>(WaitReason::kInputs) ==
              v1::Job::WAIT_REASON_INPUTS);
static_assert(static_cast<int>(ResultPart::kMap) == v1::RESULT_PART_MAP);
static_assert(static_cast<int>(ResultPart::kFunctionalMap) ==
              v1::RESULT_PART_FUNCTIONAL_MAP);

// The stages do not: core numbers them in the order they run, which changes;
// the numbers of the proto never do.
v1::Stage StageToProto(std::int32_t stage) {
  if (stage == kNoStage) return v1::STAGE_UNSPECIFIED;
  switch (static_cast<Stage>(stage)) {
    case Stage::kPrepare:
      return v1::STAGE_PREPARE;
    case Stage::kGeodesics:
      return v1::STAGE_GEODESICS;
    case Stage::kSpectral:
      return v1::STAGE_SPECTRAL;
    case Stage::kSeeds:
      return v1::STAGE_SEEDS;
    case Stage::kFirstInsertion:
      return v1::STAGE_FIRST_INSERTION;
    case Stage::kSecondInsertion:
      return v1::STAGE_SECOND_INSERTION;
    case Stage::kFinalSwapping:
      return v1::STAGE_FINAL_SWAPPING;
    case Stage::kDense:
      return v1::STAGE_DENSE;
    case Stage::kZoomOut:
      return v1::STAGE_ZOOMOUT;
    case Stage::kChoice:
      return v1::STAGE_CHOICE;
    case Stage::kAlignment:
      return v1::STAGE_ALIGNMENT;
    case Stage::kQuality:
      return v1::STAGE_QUALITY;
  }
  return v1::STAGE_UNSPECIFIED;  // not reached
}

void SetTime(absl::Time time, google::protobuf::Timestamp* timestamp) {
  const std::int64_t seconds = absl::ToUnixSeconds(time);
  timestamp->set_seconds(seconds);
  timestamp->set_nanos(static_cast<std::int32_t>(
      absl::ToInt64Nanoseconds(time - absl::FromUnixSeconds(seconds))));
}

void SetTimes(const JobRecord& record, v1::Job& job) {
  SetTime(record.create_time, job.mutable_create_time());
  if (record.start_time != absl::InfinitePast()) {
    SetTime(record.start_time, job.mutable_start_time());
  }
  if (record.end_time != absl::InfinitePast()) {
    SetTime(record.end_time, job.mutable_end_time());
  }
}

void SetRun(const JobRecord& record, v1::Job::Run& run) {
  if (record.run_timeout) {
    *run.mutable_timeout() = DurationToProto(*record.run_timeout);
  }
  run.set_faults(static_cast<std::uint32_t>(record.faults));
  run.set_unresponsive(record.unresponsive);
}

void SetProgress(const JobProgress& progress, v1::Progress& proto) {
  proto.set_stage(StageToProto(progress.stage));
  proto.set_stage_fraction(progress.stage_fraction);
  proto.set_total_fraction(progress.total_fraction);
}

void SetError(const JobError& error, v1::JobError& proto) {
  proto.set_code(static_cast<std::uint32_t>(error.code));
  proto.set_reason(error.reason);
  proto.set_message(error.message);
}

void SetSummary(const MeshSummary& summary, v1::MeshSummary& proto) {
  proto.set_vertices(static_cast<std::uint32_t>(summary.vertices));
  proto.set_faces(static_cast<std::uint32_t>(summary.faces));
  proto.set_area(summary.area);
  proto.mutable_warnings()->Add(summary.warnings.begin(),
                                summary.warnings.end());
}

void SetScores(const StoredScores& scores, v1::MapScores& proto) {
  proto.set_embedding_error(scores.embedding_error);
  proto.set_orientation_score(scores.orientation_score);
  proto.set_curvature_mismatch(scores.curvature_mismatch);
  proto.set_normal_mismatch(scores.normal_mismatch);
  proto.set_descriptor_mismatch(scores.descriptor_mismatch);
  proto.set_stretch(scores.stretch);
  proto.set_landmark_contradiction(scores.landmark_contradiction);
  proto.set_rank_value(scores.rank_value);
}

void SetQuality(const StoredQuality& quality, v1::MapQuality& proto) {
  proto.set_geodesic_distortion(quality.geodesic_distortion);
  proto.set_coverage(quality.coverage);
  proto.set_area_distortion(quality.area_distortion);
  proto.set_mean_confidence(quality.mean_confidence);
}

void SetVerdict(const StoredVerdict& verdict, v1::Verdict& proto) {
  proto.set_level(static_cast<v1::Verdict::Level>(verdict.level));
  proto.set_reason(verdict.reason);
  proto.set_advice(verdict.advice);
}

void SetLandmark(const StoredLandmark& stored, v1::LandmarkOutcome& proto) {
  proto.mutable_landmark()->set_x(
      static_cast<std::uint32_t>(stored.landmark.x));
  proto.mutable_landmark()->set_y(
      static_cast<std::uint32_t>(stored.landmark.y));
  proto.set_kept(stored.kept);
  proto.set_y_found(static_cast<std::uint32_t>(stored.y_found));
  proto.set_distance(stored.distance);
}

void SetPart(const StoredPart& part, v1::ResultPartInfo& proto) {
  proto.set_part(static_cast<v1::ResultPart>(part.part));
  proto.mutable_digest()->set_sha256(part.sha256);
  proto.mutable_digest()->set_size_bytes(
      static_cast<std::uint64_t>(part.bytes));
}

/// What is said about the map, beside what is said about the run.
void SetAssessment(const JobResult& result, v1::ResultInfo& proto) {
  proto.set_embedding_error(result.scores.embedding_error);
  proto.set_objective(result.objective);
  proto.set_orientation_score(result.scores.orientation_score);
  SetScores(result.scores, *proto.mutable_scores());
  SetQuality(result.quality, *proto.mutable_quality());
  SetVerdict(result.verdict, *proto.mutable_verdict());
  proto.set_symmetry_confidence(result.symmetry_confidence);
  for (const StoredScores& scores : result.alternatives) {
    SetScores(scores, *proto.add_alternatives()->mutable_scores());
  }
  for (const StoredLandmark& landmark : result.landmarks) {
    SetLandmark(landmark, *proto.add_landmarks());
  }
}

void SetResult(const JobResult& result, v1::ResultInfo& proto) {
  SetSummary(result.mesh_x, *proto.mutable_mesh_x());
  SetSummary(result.mesh_y, *proto.mutable_mesh_y());
  for (const StoredPart& part : result.parts) {
    SetPart(part, *proto.add_parts());
    if (part.part != ResultPart::kMap) continue;
    *proto.mutable_digest() = proto.parts().rbegin()->digest();
  }
  proto.set_unmatched(static_cast<std::uint32_t>(result.unmatched));
  SetAssessment(result, proto);
  for (const StageSeconds& time : result.stage_times) {
    v1::StageTime& added = *proto.add_stage_times();
    added.set_stage(StageToProto(time.stage));
    added.set_seconds(time.seconds);
  }
  proto.set_run_seconds(result.run_seconds);
  proto.set_peak_resident_bytes(
      static_cast<std::uint64_t>(result.peak_resident_bytes));
  proto.mutable_warnings()->Add(result.warnings.begin(), result.warnings.end());
  proto.set_profile(static_cast<v1::Profile>(result.profile + 1));
  proto.set_random_seed(result.random_seed);
}

}  // namespace

v1::Job ToProto(const JobSnapshot& snapshot) {
  const JobRecord& record = snapshot.record;
  v1::Job job;
  job.set_name(JobName(record.id));
  job.set_state(static_cast<v1::Job::State>(record.state));
  SetProgress(record.progress, *job.mutable_progress());
  job.set_queue_position(static_cast<std::uint32_t>(snapshot.queue_position));
  job.set_waiting_for(static_cast<v1::Job::WaitReason>(snapshot.waiting_for));
  job.set_memory_estimate_bytes(
      static_cast<std::uint64_t>(record.memory_estimate_bytes));
  if (record.error) SetError(*record.error, *job.mutable_error());
  if (record.result) SetResult(*record.result, *job.mutable_result());
  job.set_sequence(record.sequence);
  SetTimes(record, job);
  job.mutable_labels()->insert(record.labels.begin(), record.labels.end());
  job.set_request_id(record.request_id);
  job.set_attempt(static_cast<std::uint32_t>(record.attempt));
  job.set_priority(record.priority);
  job.set_tenant(record.tenant);
  SetRun(record, *job.mutable_run());
  return job;
}

google::protobuf::Duration DurationToProto(absl::Duration duration) {
  google::protobuf::Duration proto;
  proto.set_seconds(absl::IDivDuration(duration, absl::Seconds(1), &duration));
  proto.set_nanos(
      static_cast<std::int32_t>(absl::ToInt64Nanoseconds(duration)));
  return proto;
}

absl::StatusOr<JobState> ParseJobState(int state, const std::string& field) {
  if (state < v1::Job::STATE_QUEUED || state > v1::Job::STATE_CANCELLED) {
    return InvalidField(field, absl::StrCat(state, ", expected a Job.State"));
  }
  return static_cast<JobState>(state);
}

absl::StatusOr<ResultPart> ParseResultPart(int part, const std::string& field) {
  if (part == v1::RESULT_PART_UNSPECIFIED) return ResultPart::kMap;
  if (!v1::ResultPart_IsValid(part)) {
    return InvalidField(field, absl::StrCat(part, ", expected a ResultPart"));
  }
  return static_cast<ResultPart>(part);
}

}  // namespace isomatch
