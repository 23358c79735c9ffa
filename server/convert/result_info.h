#pragma once

#include <string>

#include "core/mesh/mesh_size.h"
#include "core/pipeline/correspondence.h"
#include "isomatch/v1/service.pb.h"
#include "server/engine/job_spec.h"
#include "server/storage/job_record.h"

namespace isomatch {

/// Returns JobResult::info: the bytes of a ResultInfo with what is known of
/// meshes and map. See JobRunner::DescribeResult.
std::string DescribeResult(const JobSpec& spec, MeshSize size_x,
                           MeshSize size_y, const Correspondence& found);

/// Returns what DescribeResult wrote, or what was written before there was that
/// (JobResult::old_info); where it cannot be read, a warning that says so.
v1::ResultInfo ResultInfoOf(const JobResult& result);

}  // namespace isomatch
