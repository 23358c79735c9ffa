#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include <grpcpp/channel.h>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "client/api/match_request.h"
#include "core/base/vertex_index.h"
#include "core/io/result_bytes.h"
#include "core/mesh/triangle_mesh.h"
#include "isomatch/v1/service.grpc.pb.h"

namespace isomatch {

/// The map in the vertex numbering of the request, and what the server says
/// about it.
struct MatchResult {
  PairSize size;
  VertexMap y_from_x;
  v1::ResultInfo info;
  std::uint64_t memory_estimate_bytes = 0;

  // The parts asked for that the result has.

  /// One entry for each vertex of X, as `y_from_x` has.
  std::optional<std::vector<PrecisePoint>> precise;
  std::optional<std::vector<float>> confidence;
  /// The map of the first alternative; info.alternatives(0) describes it.
  std::optional<VertexMap> alternative;
  std::optional<FunctionalMap> functional_map;
  /// One entry for each vertex of Y: 1 where X has a counterpart, else 0.
  std::optional<std::vector<char>> matched_y;
};

/// OK for a job that succeeded, else why it did not, or that it has not ended.
absl::Status OutcomeOf(const v1::Job& job);

/// True for a job that will not change any more.
bool IsTerminal(const v1::Job& job);

/// Which jobs ListJobs returns.
struct JobQuery {
  /// In one of these; empty for all.
  std::vector<v1::Job::State> states;
  /// With all of these.
  std::map<std::string, std::string> labels;
  /// At most so many, newest first.
  std::size_t limit = 100;
};

/// Called with every snapshot of the job, from the thread that calls.
using JobCallback = std::function<void(const v1::Job&)>;

/// Talks to an Isomatch server over a channel (see connection.h).
///
/// Calls that end with UNAVAILABLE are repeated with growing pauses for
/// `patience` in all; each message received starts the count anew. Only the
/// first call, which asks for the server's limits, has no more than three
/// seconds, unless `patience` is longer than kPatience. Uploads, watches and
/// downloads go on where they were lost. When `stop` is requested a call
/// returns CANCELLED.
///
/// Errors of each call: NOT_FOUND, FAILED_PRECONDITION, RESOURCE_EXHAUSTED,
/// UNAUTHENTICATED, PERMISSION_DENIED, INTERNAL as the server says;
/// UNAVAILABLE: no server, or it was lost.
///
/// Thread-safe.
class IsomatchClient {
 public:
  static constexpr absl::Duration kPatience = absl::Seconds(10);

  /// `is_local`: the server is on this machine, so meshes are not compressed.
  explicit IsomatchClient(const std::shared_ptr<grpc::Channel>& channel,
                          absl::Duration patience = kPatience,
                          bool is_local = false);

  /// UNAVAILABLE after about three seconds without an answer, or a longer
  /// `patience`.
  absl::StatusOr<v1::GetServerInfoResponse> GetServerInfo(
      const std::stop_token& stop = {});

  /// Creates a job, waits for its end and returns its result:
  ///
  ///   1. both meshes are encoded with Draco, losslessly in single precision;
  ///   2. they travel inside CreateJob if both fit one request, else those that
  ///      the server lacks are uploaded first and named by their SHA-256;
  ///   3. CreateJob carries a fresh request_id, so that sending it again after
  ///      a lost connection cannot start a second job;
  ///   4. the job is watched; `stop` cancels it on the server, and so does the
  ///      end of this client;
  ///   5. the size and SHA-256 of each part of the result are verified.
  ///
  /// INVALID_ARGUMENT: the server refused the input; the message names the
  /// field.
  absl::StatusOr<MatchResult> Match(const MatchRequest& request,
                                    const JobCallback& on_change = {},
                                    const std::stop_token& stop = {});

  /// Steps 1 to 3 of Match: returns the job as it was accepted. It goes on when
  /// nobody watches it.
  absl::StatusOr<v1::Job> Submit(const MatchRequest& request,
                                 const std::stop_token& stop = {});

  /// Uploads a mesh so that jobs need not bring it; true when the server had it
  /// already.
  absl::StatusOr<bool> UploadMesh(const TriangleMesh& mesh, v1::Digest* digest,
                                  const std::stop_token& stop = {});

  /// Returns the job once it has ended, however it ended.
  absl::StatusOr<v1::Job> Watch(const std::string& name,
                                const JobCallback& on_change = {},
                                const std::stop_token& stop = {});

  absl::StatusOr<v1::Job> GetJob(const std::string& name,
                                 const std::stop_token& stop = {});
  absl::StatusOr<std::vector<v1::Job>> ListJobs(
      const JobQuery& query, const std::stop_token& stop = {});
  absl::StatusOr<v1::Job> CancelJob(const std::string& name,
                                    const std::stop_token& stop = {});
  absl::Status DeleteJob(const std::string& name,
                         const std::stop_token& stop = {});

  /// Returns the map of a job that succeeded, and those of `parts` that its
  /// result has. DATA_LOSS: they arrived damaged.
  absl::StatusOr<MatchResult> Fetch(const v1::Job& job,
                                    const std::vector<v1::ResultPart>& parts,
                                    const std::stop_token& stop = {});

 private:
  struct DownloadedPart {
    std::string bytes;
    PairSize size;
  };

  absl::StatusOr<v1::Job> Create(const MatchRequest& request,
                                 v1::DisconnectPolicy policy,
                                 const std::stop_token& stop);
  absl::Status Upload(const std::string& bytes, std::uint64_t chunk_bytes,
                      const std::stop_token& stop);
  /// Bytes of the mesh that the server has; nullopt when it has them all.
  absl::StatusOr<std::optional<std::uint64_t>> FindReceived(
      const v1::Digest& digest, const std::stop_token& stop);
  absl::Status SendFrom(std::uint64_t offset, const std::string& bytes,
                        const v1::Digest& digest, std::uint64_t chunk_bytes,
                        const std::stop_token& stop);
  absl::StatusOr<v1::Job> SendCreateJob(const v1::CreateJobRequest& request,
                                        const std::stop_token& stop);
  /// As Watch; `stop` cancels the job too.
  absl::StatusOr<v1::Job> WatchOrCancel(const std::string& name,
                                        const JobCallback& on_change,
                                        const std::stop_token& stop);
  absl::StatusOr<DownloadedPart> Download(const std::string& name,
                                          v1::ResultPart part,
                                          const std::stop_token& stop);

  std::unique_ptr<v1::CorrespondenceService::Stub> stub_;
  absl::Duration patience_;
  DracoOptions draco_;
};

}  // namespace isomatch
