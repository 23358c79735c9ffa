#pragma once

#include <string>

#include "absl/status/status.h"
#include "core/base/sha256.h"
#include "isomatch/v1/service.pb.h"
#include "server/convert/request_limits.h"
#include "server/jobs/partial_uploads.h"
#include "server/storage/blob_store.h"

namespace isomatch {

/// What has come of one UploadMesh stream.
///
///   NEW ── header ──> RECEIVING ── chunks ──> RECEIVING ── End ──> OVER
///    |                    |                                          ^
///    |                    +── BreakOff: the bytes are kept ──────────+
///    +── header of a mesh that the server has: known() ──────────────+
///
/// An error leads to OVER too, and nothing is kept: except when End finds too
/// few bytes, since it looks alike when a stream ends and when it is lost, and
/// when there is no room for the next chunk: then they are kept at once in
/// memory, or else by BreakOff.
///
/// Not thread-safe.
class MeshUpload {
 public:
  /// What it works with; outlives it.
  struct Environment {
    BlobStore* blobs;
    PartialUploads* partials;
    const RequestLimits& limits;
  };

  MeshUpload(const Environment& environment, const std::string& tenant)
      : environment_(environment), key_{tenant, ""} {}

  /// Takes the next message. INVALID_ARGUMENT (UPLOAD_MALFORMED,
  /// MESH_TOO_LARGE, INVALID_FIELD), RESOURCE_EXHAUSTED (UPLOAD_QUOTA).
  absl::Status Take(const v1::UploadMeshRequest& request);

  /// Checks size and digest and stores the mesh. INVALID_ARGUMENT
  /// (UPLOAD_MALFORMED, DIGEST_MISMATCH), RESOURCE_EXHAUSTED (UPLOAD_QUOTA,
  /// STORAGE_QUOTA).
  absl::Status End();

  /// Keeps the bytes of an upload that goes on later; does nothing after the
  /// end.
  void BreakOff();

  /// Whether BreakOff has bytes to keep.
  bool leaves_bytes() const {
    return stage_ == Stage::kReceiving || stage_ == Stage::kBroken;
  }

  /// True when the server has the mesh already and needs no chunks.
  bool known() const { return known_; }

  /// What the upload's header says its bytes are.
  const v1::Digest& digest() const { return digest_; }

 private:
  enum class Stage {
    kNew,        ///< no header came
    kReceiving,  ///< chunks are expected
    kBroken,     ///< there was no room for one; BreakOff follows
    kOver,       ///< stored, known, refused or broken off
  };

  absl::Status Begin(const v1::UploadMeshRequest& request);
  absl::Status ContinueAt(std::uint64_t offset);
  absl::Status Append(const std::string& chunk);
  absl::Status Store();

  const Environment environment_;
  BlobKey key_;
  Stage stage_ = Stage::kNew;
  bool known_ = false;
  v1::Digest digest_;
  /// What has come, with room for that.
  PartialUpload received_;
  /// Digest of the bytes in `received_`.
  Sha256 sha256_;
};

}  // namespace isomatch
