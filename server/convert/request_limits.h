#pragma once

#include <cstdint>
#include <limits>

#include "core/io/draco_mesh.h"
#include "server/jobs/caller.h"
#include "server/jobs/tenant_limits.h"

namespace isomatch {

/// What a request may contain; told to clients by GetServerInfo.
struct RequestLimits {
  std::int64_t max_request_bytes = std::int64_t{4} << 20;
  std::int64_t max_chunk_bytes = std::int64_t{1} << 20;
  std::int64_t max_mesh_bytes = std::int64_t{256} << 20;
  TenantLimits tenant;
  int max_landmarks = 10'000;
  int max_queued_jobs = 100;
  DracoLimits draco;
  /// What the meshes of a request may take while they are decoded.
  std::int64_t max_reading_bytes = std::numeric_limits<std::int64_t>::max();

  // Written in service.proto too.
  static constexpr int kMaxDigests = 1000;
  static constexpr int kMaxPageSize = 1000;
  static constexpr int kDefaultPageSize = 100;
  static constexpr int kMaxThreads = 1024;
  static constexpr int kMaxPriority = kMostPriority;
  static constexpr size_t kMaxRequestIdBytes = 128;
  static constexpr size_t kMaxLabels = 16;
  static constexpr size_t kMaxLabelKeyBytes = 63;
  static constexpr size_t kMaxLabelValueBytes = 255;
};

}  // namespace isomatch
