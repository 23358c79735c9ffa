#pragma once

#include <map>
#include <memory>

#include <grpcpp/server_context.h>
#include <grpcpp/support/string_ref.h>

#include "absl/status/statusor.h"
#include "server/jobs/caller.h"
#include "server/rpc/api_keys.h"

namespace isomatch {

/// Tells who calls and whether they may. Thread-safe.
class Access {
 public:
  using Metadata = std::multimap<grpc::string_ref, grpc::string_ref>;

  /// Without `keys` (null) everybody is the default Caller.
  explicit Access(std::unique_ptr<ApiKeys> keys);

  /// Returns who calls, by the API key in the metadata: `api-key: KEY`, or
  /// else `authorization: Bearer KEY`. UNAUTHENTICATED: API_KEY_MISSING,
  /// API_KEY_WRONG. PERMISSION_DENIED: ROLE_TOO_LOW, the key may do less than
  /// `needed`.
  absl::StatusOr<Caller> Identify(const grpc::CallbackServerContext& call,
                                  Role needed) const;

  /// The same for metadata alone.
  absl::StatusOr<Caller> IdentifyBy(const Metadata& metadata,
                                    Role needed) const;

 private:
  const std::unique_ptr<ApiKeys> keys_;
};

}  // namespace isomatch
