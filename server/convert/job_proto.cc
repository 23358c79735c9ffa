#include "server/convert/job_proto.h"

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/pipeline/progress.h"
#include "server/convert/job_name.h"
#include "server/convert/result_info.h"
#include "server/jobs/errors.h"

namespace isomatch {
namespace {

// These enums of core, of the records and of the proto count alike.
static_assert(kNoStage == v1::STAGE_UNSPECIFIED);
static_assert(static_cast<int>(Stage::kPrepare) == v1::STAGE_PREPARE);
static_assert(static_cast<int>(Stage::kZoomOut) == v1::STAGE_ZOOMOUT);
static_assert(static_cast<int>(Stage::kChoice) == v1::STAGE_CHOICE);
static_assert(static_cast<int>(Stage::kAlignment) == v1::STAGE_ALIGNMENT);
static_assert(static_cast<int>(Stage::kQuality) == v1::STAGE_QUALITY);
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
static_assert(static_cast<int>(ResultPart::kMaskY) == v1::RESULT_PART_MASK_Y);
static_assert(static_cast<int>(ResultPart::kMaskY) == v1::ResultPart_MAX);

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
  proto.set_stage(static_cast<v1::Stage>(progress.stage));
  proto.set_stage_fraction(progress.stage_fraction);
  proto.set_total_fraction(progress.total_fraction);
  proto.set_has_map(progress.has_map);
}

void SetError(const JobError& error, v1::JobError& proto) {
  proto.set_code(static_cast<std::uint32_t>(error.code));
  proto.set_reason(error.reason);
  proto.set_message(error.message);
}

void SetPart(const StoredPart& part, v1::ResultPartInfo& proto) {
  proto.set_part(static_cast<v1::ResultPart>(part.part));
  proto.mutable_digest()->set_sha256(part.sha256);
  proto.mutable_digest()->set_size_bytes(
      static_cast<std::uint64_t>(part.bytes));
}

void SetResult(const JobResult& result, v1::ResultInfo& proto) {
  proto = ResultInfoOf(result);
  for (const StoredPart& part : result.parts) {
    SetPart(part, *proto.add_parts());
    if (part.part != ResultPart::kMap) continue;
    *proto.mutable_digest() = proto.parts().rbegin()->digest();
  }
  for (const StageSeconds& time : result.stage_times) {
    v1::StageTime& added = *proto.add_stage_times();
    added.set_stage(static_cast<v1::Stage>(time.stage));
    added.set_seconds(time.seconds);
  }
  proto.set_run_seconds(result.run_seconds);
  proto.set_peak_resident_bytes(
      static_cast<std::uint64_t>(result.peak_resident_bytes));
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
