#pragma once

#include <memory>

#include <grpcpp/server_context.h>

#include "absl/status/statusor.h"
#include "server/jobs/caller.h"
#include "server/rpc/security/api_keys.h"
#include "server/rpc/security/call_metadata.h"

namespace isomatch {

/// Tells who calls and whether they may. Thread-safe.
class Access {
 public:
  /// Without `keys` (null) everybody is the default Caller.
  explicit Access(std::unique_ptr<ApiKeys> keys);

  /// Returns who calls, by the API key in the metadata: `api-key: KEY`, or
  /// else `authorization: Bearer KEY`. UNAUTHENTICATED: API_KEY_MISSING,
  /// API_KEY_WRONG. PERMISSION_DENIED: ROLE_TOO_LOW, the key may do less than
  /// `needed`.
  absl::StatusOr<Caller> Identify(const grpc::CallbackServerContext& call,
                                  Role needed) const;

  /// The same for metadata alone.
  absl::StatusOr<Caller> IdentifyBy(const CallMetadata& metadata,
                                    Role needed) const;

 private:
  const std::unique_ptr<ApiKeys> keys_;
};

}  // namespace isomatch
