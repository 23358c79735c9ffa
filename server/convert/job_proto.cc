#include "server/convert/job_proto.h"

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/pipeline/matcher.h"
#include "server/convert/job_name.h"
#include "server/jobs/errors.h"

namespace isomatch {
namespace {

// The enums of core, of the records and of the proto count alike.
static_assert(static_cast<int>(Stage::kPrepare) + 1 == v1::STAGE_PREPARE);
static_assert(static_cast<int>(Stage::kQuality) + 1 == v1::STAGE_QUALITY);
static_assert(static_cast<int>(Profile::kDefault) + 1 == v1::PROFILE_DEFAULT);
static_assert(static_cast<int>(Profile::kPaper) + 1 == v1::PROFILE_PAPER);
static_assert(static_cast<int>(JobState::kQueued) == v1::Job::STATE_QUEUED);
static_assert(static_cast<int>(JobState::kCancelled) ==
              v1::Job::STATE_CANCELLED);

v1::Stage StageToProto(std::int32_t stage) {
  return static_cast<v1::Stage>(stage + 1);  // kNoStage: STAGE_UNSPECIFIED
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

void SetResult(const JobResult& result, v1::ResultInfo& proto) {
  SetSummary(result.mesh_x, *proto.mutable_mesh_x());
  SetSummary(result.mesh_y, *proto.mutable_mesh_y());
  proto.mutable_digest()->set_sha256(result.map_sha256);
  proto.mutable_digest()->set_size_bytes(
      static_cast<std::uint64_t>(result.map_bytes));
  proto.set_unmatched(static_cast<std::uint32_t>(result.unmatched));
  proto.set_embedding_error(result.embedding_error);
  proto.set_objective(result.objective);
  proto.set_orientation_score(result.orientation_score);
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
  job.set_memory_estimate_bytes(
      static_cast<std::uint64_t>(record.memory_estimate_bytes));
  if (record.error) SetError(*record.error, *job.mutable_error());
  if (record.result) SetResult(*record.result, *job.mutable_result());
  job.set_sequence(record.sequence);
  SetTimes(record, job);
  job.mutable_labels()->insert(record.labels.begin(), record.labels.end());
  job.set_request_id(record.request_id);
  return job;
}

absl::StatusOr<JobState> ParseJobState(int state, const std::string& field) {
  if (state < v1::Job::STATE_QUEUED || state > v1::Job::STATE_CANCELLED) {
    return InvalidField(field, absl::StrCat(state, ", expected a Job.State"));
  }
  return static_cast<JobState>(state);
}

}  // namespace isomatch
