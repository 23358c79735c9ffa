#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "isomatch/v1/service.pb.h"
#include "server/convert/parse_create_job.h"
#include "server/engine/job_spec.h"
#include "server/storage/job_record.h"

namespace isomatch {

/// Returns the SHA-256 of the request, the same for equal requests.
std::string RequestSha256(const v1::CreateJobRequest& request);

/// Returns what LoadJobSpec needs later: the request with digests in place of
/// the meshes within it, then both meshes.
/// REQUIRES: ParseCreateJob accepts the request.
std::vector<JobInput> MakeJobInputs(v1::CreateJobRequest request);

/// Reads a job again from its inputs. DATA_LOSS (CONTENT_LOST) when the request
/// is not there; errors of ParseCreateJob, MESH_MISSING and
/// CONTENT_UNAVAILABLE among them.
absl::StatusOr<JobSpec> LoadJobSpec(const JobRecord& record,
                                    const ParseContext& context);

}  // namespace isomatch
