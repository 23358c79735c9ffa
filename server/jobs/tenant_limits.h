#pragma once

#include <cstdint>
#include <limits>

namespace isomatch {

/// What one tenant may have of the server. The defaults are those of a server
/// that has only one.
struct TenantLimits {
  static constexpr int kNone = std::numeric_limits<int>::max();

  int queued_jobs = 100;
  int running_jobs = kNone;
  /// Jobs with a result that are remembered, and as many without.
  int kept_jobs = kNone;
  /// Bytes of stored meshes, requests and results, counted with those of a job
  /// that is to be accepted; 0 for no limit. Results are stored in any case.
  std::int64_t stored_bytes = 0;
  /// UploadMesh calls at a time, and what they have brought and uploads that
  /// broke off have left.
  int uploads = kNone;
  std::int64_t upload_bytes = std::numeric_limits<std::int64_t>::max();
  /// CreateJob calls that wait to be read, and their bytes.
  int requests = kNone;
  std::int64_t request_bytes = std::numeric_limits<std::int64_t>::max();
  /// Bytes of the parts of results that are being sent.
  std::int64_t download_bytes = std::numeric_limits<std::int64_t>::max();
};

}  // namespace isomatch
