#include "client/api/match_request.h"

#include <algorithm>

#include "client/api/rpc_status.h"
#include "core/base/sha256.h"

namespace isomatch {
namespace {

// Room in a request for all but the meshes, landmarks counted apart: options
// and, at their limits, labels.
constexpr std::uint64_t kRequestOverheadBytes = 12 << 10;
// A landmark with its tag, at most.
constexpr std::uint64_t kLandmarkBytes = 16;

void SetMesh(const EncodedMesh& encoded, VertexIndex vertices, bool is_inline,
             v1::Mesh* mesh) {
  if (is_inline) {
    mesh->set_draco(encoded.bytes);
  } else {
    *mesh->mutable_digest() = DigestOf(encoded.bytes);
  }
  mesh->set_vertex_order(encoded.vertex_order == VertexOrder::kIdAttribute
                             ? v1::VERTEX_ORDER_ID_ATTRIBUTE
                             : v1::VERTEX_ORDER_DECODED);
  mesh->set_vertex_count(static_cast<std::uint32_t>(vertices));
}

bool Wants(const MatchRequest& request, v1::ResultPart part) {
  return std::find(request.parts.begin(), request.parts.end(), part) !=
         request.parts.end();
}

void SetOptions(const MatchRequest& request, v1::MatchOptions* options) {
  options->set_profile(request.profile);
  options->set_random_seed(request.random_seed);
  options->set_threads(request.threads);
  options->set_landmarks_exact(request.landmarks_exact);
  options->set_relation(request.relation);
  options->set_scale(request.scale);
  options->set_functional_map(Wants(request, v1::RESULT_PART_FUNCTIONAL_MAP));
  options->set_memory_limit_bytes(request.memory_limit_bytes);
  if (request.solved_vertices) {
    options->set_solved_vertices(*request.solved_vertices);
  }
}

google::protobuf::Duration ToProto(absl::Duration duration) {
  google::protobuf::Duration proto;
  proto.set_seconds(absl::IDivDuration(duration, absl::Seconds(1), &duration));
  proto.set_nanos(static_cast<std::int32_t>(
      absl::IDivDuration(duration, absl::Nanoseconds(1), &duration)));
  return proto;
}

}  // namespace

v1::Digest DigestOf(const std::string& bytes) {
  v1::Digest digest;
  digest.set_sha256(Sha256Hex(bytes));
  digest.set_size_bytes(bytes.size());
  return digest;
}

bool FitsOneRequest(const EncodedPair& meshes, const MatchRequest& request,
                    std::uint64_t limit) {
  return meshes.x.bytes.size() + meshes.y.bytes.size() +
             request.landmarks.size() * kLandmarkBytes +
             kRequestOverheadBytes <=
         limit;
}

v1::CreateJobRequest MakeCreateJobRequest(const MatchRequest& request,
                                          const EncodedPair& meshes,
                                          bool is_inline) {
  v1::CreateJobRequest message;
  SetMesh(meshes.x, request.mesh_x.num_vertices(), is_inline,
          message.mutable_mesh_x());
  SetMesh(meshes.y, request.mesh_y.num_vertices(), is_inline,
          message.mutable_mesh_y());
  for (const VertexMatch& landmark : request.landmarks) {
    v1::Landmark* added = message.add_landmarks();
    added->set_x(static_cast<std::uint32_t>(landmark.x));
    added->set_y(static_cast<std::uint32_t>(landmark.y));
  }
  SetOptions(request, message.mutable_options());
  message.set_priority(request.priority);
  message.mutable_labels()->insert(request.labels.begin(),
                                   request.labels.end());
  if (request.queue_timeout != absl::InfiniteDuration()) {
    *message.mutable_queue_timeout() = ToProto(request.queue_timeout);
  }
  if (request.run_timeout != absl::InfiniteDuration()) {
    *message.mutable_run_timeout() = ToProto(request.run_timeout);
  }
  if (request.deadline != absl::InfiniteDuration()) {
    *message.mutable_deadline() = ToProto(request.deadline);
  }
  message.set_request_id(RandomUuid());
  return message;
}

}  // namespace isomatch
