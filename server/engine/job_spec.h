#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "core/mesh/mesh_size.h"
#include "core/mesh/triangle_mesh.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/match_options.h"
#include "server/storage/blob_store.h"

namespace isomatch {

/// A blob that running a job needs.
struct JobInput {
  std::string sha256;
  /// Not set: it is in the blob store already.
  std::optional<std::string> bytes;
};

/// A checked request for a job.
struct JobSpec {
  TriangleMesh mesh_x;
  TriangleMesh mesh_y;
  std::vector<Landmark> landmarks;
  MatchOptions options;
  /// What was made of the request otherwise than asked; told with the result.
  std::vector<std::string> warnings;
  std::map<std::string, std::string> labels;
  /// Not set means no limit.
  std::optional<absl::Duration> queue_timeout;
  std::optional<absl::Duration> run_timeout;
  /// When the best map there is has to do, from the job's start on. Not set
  /// means never.
  std::optional<absl::Duration> deadline;
  /// -100 to 100; higher ones start first.
  std::int32_t priority = 0;
  /// Cancelled once nobody has watched it for a while; see DisconnectGuard.
  bool cancel_when_unwatched = false;
  /// Only check; nothing is kept.
  bool validate_only = false;
  /// Empty for none.
  std::string request_id;
  /// SHA-256 of the request; tells a retry from another request.
  std::string request_sha256;
  /// What the prepared shapes are found by; see PreparedCache. Not set: they
  /// are not looked for.
  std::optional<BlobKey> prepared_x;
  std::optional<BlobKey> prepared_y;
  /// What all above is read from again when the job starts, if that is not as
  /// soon as it was created. Emptied when it is stored.
  std::vector<JobInput> inputs;
};

/// Returns the bytes that the two meshes hold.
inline std::int64_t MeshBytes(const JobSpec& spec) {
  return static_cast<std::int64_t>(MeshBytes(SizeOf(spec.mesh_x)) +
                                   MeshBytes(SizeOf(spec.mesh_y)));
}

}  // namespace isomatch
