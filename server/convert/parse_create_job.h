#pragma once

#include <functional>
#include <string>

#include "absl/status/statusor.h"
#include "isomatch/v1/service.pb.h"
#include "server/convert/request_limits.h"
#include "server/engine/job_spec.h"
#include "server/jobs/job_runner.h"
#include "server/storage/blob_store.h"

namespace isomatch {

/// What a request is read with.
struct ParseContext {
  BlobStore* blobs;
  const JobRunner* runner;
  RequestLimits limits;
  /// What a job gets that asks for 0 threads, and the most it gets.
  int threads_per_job = 1;
  /// The same where other processes run the jobs; takes the place of the
  /// number.
  std::function<int()> threads_elsewhere = {};
};

/// Returns the job that the tenant's request describes, its meshes decoded and
/// all checked; request_sha256 and inputs are left empty. Errors name the
/// field: INVALID_ARGUMENT (INVALID_FIELD, MESH_MALFORMED, MESH_TOO_LARGE,
/// MATCH_OUT_OF_RANGE, LANDMARKS_CONTRADICT), FAILED_PRECONDITION
/// (MESH_MISSING, JOB_NEEDS_MORE_MEMORY_THAN_BUDGET), UNAVAILABLE
/// (CONTENT_UNAVAILABLE).
absl::StatusOr<JobSpec> ParseCreateJob(const v1::CreateJobRequest& request,
                                       const ParseContext& context,
                                       const std::string& tenant);

}  // namespace isomatch
