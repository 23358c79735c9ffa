#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "core/base/vertex_index.h"
#include "core/io/draco_mesh.h"
#include "core/mesh/triangle_mesh.h"
#include "isomatch/v1/service.pb.h"

namespace isomatch {

/// What to match, and how.
struct MatchRequest {
  /// REQUIRES: both pass ValidateMesh.
  TriangleMesh mesh_x;
  TriangleMesh mesh_y;
  /// When given, they take the place of generated seeds.
  std::vector<VertexMatch> landmarks;
  v1::Profile profile = v1::PROFILE_DEFAULT;
  std::uint64_t random_seed = 1;
  /// 0 means the server's share.
  std::uint32_t threads = 0;
  v1::Relation relation = v1::RELATION_WHOLE;
  v1::LengthScale scale = v1::LENGTH_SCALE_AUTO;
  /// Keeps every landmark, whatever contradicts it.
  bool landmarks_exact = false;
  /// What to download beside the map. RESULT_PART_FUNCTIONAL_MAP is computed
  /// only when it is among them.
  std::vector<v1::ResultPart> parts = {};
  /// As MatchOptions.solved_vertices; not set: the profile's choice.
  std::optional<std::uint32_t> solved_vertices = {};
  /// As MatchOptions.memory_limit_bytes; 0 for none.
  std::uint64_t memory_limit_bytes = 0;
  /// -100 to 100; jobs of a higher one start first.
  std::int32_t priority = 0;
  /// Found again by ListJobs.
  std::map<std::string, std::string> labels = {};
  /// How long the job may wait, and run.
  absl::Duration queue_timeout = absl::InfiniteDuration();
  absl::Duration run_timeout = absl::InfiniteDuration();
  /// As CreateJobRequest.deadline.
  absl::Duration deadline = absl::InfiniteDuration();
};

/// The two meshes of a request, compressed with Draco.
struct EncodedPair {
  EncodedMesh x;
  EncodedMesh y;
};

/// The digest that names `bytes`.
v1::Digest DigestOf(const std::string& bytes);

/// True when both meshes can travel in one CreateJob of `limit` bytes.
bool FitsOneRequest(const EncodedPair& meshes, const MatchRequest& request,
                    std::uint64_t limit);

/// Returns the call for a new job, with a fresh request_id and the server's own
/// disconnect policy. The meshes are in it when `is_inline`, else named by
/// their digests.
v1::CreateJobRequest MakeCreateJobRequest(const MatchRequest& request,
                                          const EncodedPair& meshes,
                                          bool is_inline);

}  // namespace isomatch
