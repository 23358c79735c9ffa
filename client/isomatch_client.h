#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include <grpcpp/channel.h>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/result_parts.h"
#include "core/base/vertex_index.h"
#include "core/io/draco_mesh.h"
#include "core/mesh/triangle_mesh.h"
#include "isomatch/v1/service.grpc.pb.h"

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
  /// Keeps every landmark, whatever contradicts it.
  bool landmarks_exact = false;
  /// What to download beside the map. RESULT_PART_FUNCTIONAL_MAP is computed
  /// only when it is among them.
  std::vector<v1::ResultPart> parts = {};
  /// As MatchOptions.solved_vertices; not set: the profile's choice.
  std::optional<std::uint32_t> solved_vertices = {};
  /// -100 to 100; jobs of a higher one start first.
  std::int32_t priority = 0;
};

/// The map in the vertex numbering of the request, and what the server says
/// about it.
struct MatchResult {
  VertexMap y_from_x;
  v1::ResultInfo info;
  std::uint64_t memory_estimate_bytes = 0;

  // The parts asked for that the result has.

  /// One entry for each vertex of X, as `y_from_x` has.
  std::optional<std::vector<PrecisePoint>> precise;
  std::optional<std::vector<float>> confidence;
  /// Of info.alternatives(0).
  std::optional<VertexMap> alternative;
  std::optional<FunctionalMap> functional_map;
};

/// Called with every snapshot of the job, from the thread that calls Match.
using JobCallback = std::function<void(const v1::Job&)>;

/// Talks to an Isomatch server over a channel (see connection.h). Match goes
/// through these steps:
///
///   1. both meshes are compressed with Draco, losslessly in single precision;
///   2. they travel inside CreateJob if both fit one request, else those that
///      the server lacks are uploaded first and named by their SHA-256;
///   3. CreateJob carries a fresh request_id, so that sending it again after a
///      lost connection cannot start a second job;
///   4. UploadMesh, WatchJob and DownloadResult go on where they were lost;
///   5. the size and SHA-256 of each part of the result are verified.
///
/// Calls that end with UNAVAILABLE are repeated with growing pauses, about ten
/// seconds in all; each message received starts the count anew. Only the first
/// call, which asks for the server's limits, has no more than three. When
/// `stop` is requested the job is cancelled on the server and the call returns
/// CANCELLED. A client that vanishes has its job cancelled too.
///
/// Thread-safe.
class IsomatchClient {
 public:
  explicit IsomatchClient(const std::shared_ptr<grpc::Channel>& channel);

  /// UNAVAILABLE after about three seconds without an answer.
  absl::StatusOr<v1::GetServerInfoResponse> GetServerInfo(
      const std::stop_token& stop = {});

  /// INVALID_ARGUMENT: the server refused the input; the message names the
  /// field. UNAVAILABLE: no server, or it was lost. CANCELLED,
  /// RESOURCE_EXHAUSTED, FAILED_PRECONDITION, INTERNAL: as the server says.
  absl::StatusOr<MatchResult> Match(const MatchRequest& request,
                                    const JobCallback& on_change = {},
                                    const std::stop_token& stop = {});

 private:
  using Encoded = std::pair<EncodedMesh, EncodedMesh>;

  absl::Status UploadMissing(const Encoded& meshes, std::uint64_t chunk_bytes,
                             const std::stop_token& stop);
  absl::Status Upload(const std::string& bytes, std::uint64_t chunk_bytes,
                      const std::stop_token& stop);
  // Bytes of the mesh that the server has; nullopt when it has them all.
  absl::StatusOr<std::optional<std::uint64_t>> FindReceived(
      const v1::Digest& digest, const std::stop_token& stop);
  absl::Status SendFrom(std::uint64_t offset, const std::string& bytes,
                        const v1::Digest& digest, std::uint64_t chunk_bytes,
                        const std::stop_token& stop);
  absl::StatusOr<v1::Job> CreateJob(const v1::CreateJobRequest& request,
                                    const std::stop_token& stop);
  absl::StatusOr<v1::Job> WatchToEnd(const v1::Job& created,
                                     const JobCallback& on_change,
                                     const std::stop_token& stop);
  absl::Status CancelJob(const std::string& name);
  absl::StatusOr<MatchResult> Fetch(const MatchRequest& request,
                                    const v1::Job& job,
                                    const std::stop_token& stop);
  absl::StatusOr<std::string> Download(const std::string& name,
                                       v1::ResultPart part,
                                       const std::stop_token& stop);

  std::unique_ptr<v1::CorrespondenceService::Stub> stub_;
};

}  // namespace isomatch
