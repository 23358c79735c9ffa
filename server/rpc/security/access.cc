#include "server/rpc/security/access.h"

#include <optional>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/string_view.h"
#include "core/base/status_macros.h"
#include "server/jobs/errors.h"

namespace isomatch {
namespace {

/// Empty when there is none.
absl::string_view ValueOf(const CallMetadata& metadata, const char* name) {
  const auto found = metadata.find(name);
  if (found == metadata.end()) return "";
  return {found->second.data(), found->second.size()};
}

/// Returns the key that a call carries; empty when it carries none.
absl::string_view KeyOf(const CallMetadata& metadata) {
  constexpr absl::string_view kBearer = "Bearer ";
  const absl::string_view key =
      absl::StripAsciiWhitespace(ValueOf(metadata, "api-key"));
  if (!key.empty()) return key;
  const absl::string_view value = ValueOf(metadata, "authorization");
  if (!absl::StartsWithIgnoreCase(value, kBearer)) return "";
  return absl::StripAsciiWhitespace(value.substr(kBearer.size()));
}

}  // namespace

Access::Access(std::unique_ptr<ApiKeys> keys) : keys_(std::move(keys)) {}

absl::StatusOr<Caller> Access::Identify(const grpc::CallbackServerContext& call,
                                        Role needed) const {
  ISOMATCH_ASSIGN_OR_RETURN(Caller caller,
                            IdentifyBy(call.client_metadata(), needed));
  caller.call_id = CallIdOf(call.client_metadata());
  caller.trace_parent = TraceParentOf(call.client_metadata());
  return caller;
}

absl::StatusOr<Caller> Access::IdentifyBy(const CallMetadata& metadata,
                                          Role needed) const {
  if (keys_ == nullptr) return Caller();
  const absl::string_view key = KeyOf(metadata);
  if (key.empty()) return ApiKeyMissing();
  std::optional<Caller> caller = keys_->Find(key);
  if (!caller) return ApiKeyWrong();
  if (caller->role < needed) return RoleTooLow(caller->role, needed);
  return *std::move(caller);
}

}  // namespace isomatch
