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

/// Sets what LoadJobSpec needs later, the inputs: the request with digests in
/// place of the meshes within it, then both meshes. Sets what the prepared
/// shapes are found by, too. LoadJobSpec then returns the same, but for the
/// inputs and request_sha256, which it leaves empty. REQUIRES: `spec` is what
/// ParseCreateJob made of the request.
void SetInputs(const std::string& tenant, v1::CreateJobRequest request,
               JobSpec& spec);

/// Reads a job again from its inputs. DATA_LOSS (CONTENT_LOST) when the request
/// is not there; errors of ParseCreateJob, MESH_MISSING and
/// CONTENT_UNAVAILABLE among them.
absl::StatusOr<JobSpec> LoadJobSpec(const JobRecord& record,
                                    const ParseContext& context);

}  // namespace isomatch
