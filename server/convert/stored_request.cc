#include "server/convert/stored_request.h"

#include <algorithm>
#include <cstdint>
#include <utility>

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include "absl/strings/str_cat.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "core/pipeline/prepared_shape.h"
#include "server/jobs/errors.h"

namespace isomatch {
namespace {

/// The same bytes for equal requests.
std::string Serialize(const v1::CreateJobRequest& request) {
  std::string bytes;
  {
    google::protobuf::io::StringOutputStream stream(&bytes);
    google::protobuf::io::CodedOutputStream coded(&stream);
    coded.SetSerializationDeterministic(true);
    request.SerializeToCodedStream(&coded);
  }
  return bytes;
}

/// Takes the mesh's bytes, if it has them, and leaves their digest.
JobInput TakeMesh(v1::Mesh& mesh) {
  if (!mesh.has_draco()) return {mesh.digest().sha256(), std::nullopt};
  std::string bytes = std::move(*mesh.mutable_draco());
  v1::Digest& digest = *mesh.mutable_digest();
  digest.set_sha256(Sha256Hex(bytes));
  digest.set_size_bytes(bytes.size());
  return {digest.sha256(), std::move(bytes)};
}

/// REQUIRES: the mesh is named by digest.
BlobKey PreparedKey(const std::string& tenant, const v1::Mesh& mesh,
                    const std::string& preparation) {
  return {tenant, Sha256Hex(absl::StrCat(
                      mesh.digest().sha256(), " ", mesh.vertex_order(), " ",
                      mesh.vertex_count(), " ", preparation))};
}

/// REQUIRES: the meshes are named by digest.
void SetPreparedKeys(const std::string& tenant,
                     const v1::CreateJobRequest& request, JobSpec& spec) {
  const std::string preparation = PreparationText(spec.options);
  spec.prepared_x = PreparedKey(tenant, request.mesh_x(), preparation);
  spec.prepared_y = PreparedKey(tenant, request.mesh_y(), preparation);
}

}  // namespace

std::string RequestSha256(const v1::CreateJobRequest& request) {
  return Sha256Hex(Serialize(request));
}

void SetInputs(const std::string& tenant, v1::CreateJobRequest request,
               JobSpec& spec) {
  JobInput mesh_x = TakeMesh(*request.mutable_mesh_x());
  JobInput mesh_y = TakeMesh(*request.mutable_mesh_y());
  SetPreparedKeys(tenant, request, spec);
  std::string bytes = Serialize(request);
  std::string sha256 = Sha256Hex(bytes);
  spec.inputs.clear();
  spec.inputs.push_back({std::move(sha256), std::move(bytes)});
  spec.inputs.push_back(std::move(mesh_x));
  spec.inputs.push_back(std::move(mesh_y));
}

absl::StatusOr<JobSpec> LoadJobSpec(const JobRecord& record,
                                    const ParseContext& context) {
  v1::CreateJobRequest request;
  if (record.inputs.empty()) return ContentLost(record.id, "request");
  const auto bytes = context.blobs->Get({record.tenant, record.inputs.front()});
  if (!bytes.ok() && !absl::IsNotFound(bytes.status())) {
    return ContentUnavailable("request", bytes.status());
  }
  if (!bytes.ok() || !request.ParseFromString(**bytes)) {
    return ContentLost(record.id, "request");
  }
  ISOMATCH_ASSIGN_OR_RETURN(JobSpec spec,
                            ParseCreateJob(request, context, record.tenant));
  // No more than its reservation counts with, whatever the server gives now.
  if (record.threads > 0) {
    spec.options.threads = std::min(spec.options.threads, record.threads);
  }
  SetPreparedKeys(record.tenant, request, spec);
  return spec;
}

}  // namespace isomatch
