#pragma once

#include "absl/status/statusor.h"
#include "isomatch/v1/service.pb.h"
#include "server/jobs/job_manager.h"
#include "server/storage/job_record.h"

namespace isomatch {

/// Returns the job as clients see it.
v1::Job ToProto(const JobSnapshot& snapshot);

google::protobuf::Duration DurationToProto(absl::Duration duration);

/// Returns the state; INVALID_ARGUMENT on `field` when it is not one.
absl::StatusOr<JobState> ParseJobState(int state, const std::string& field);

/// Returns the part, the map for UNSPECIFIED; INVALID_ARGUMENT on `field` when
/// it is none.
absl::StatusOr<ResultPart> ParseResultPart(int part, const std::string& field);

}  // namespace isomatch
