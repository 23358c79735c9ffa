#pragma once

#include <map>
#include <string>

#include <grpcpp/support/string_ref.h>

namespace isomatch {

/// What a client sends with a call, beside its messages.
using CallMetadata = std::multimap<grpc::string_ref, grpc::string_ref>;

inline constexpr char kRequestIdKey[] = "x-request-id";

/// Returns the first value of `key` that is as it should be, or "".
std::string FindMetadata(const CallMetadata& metadata, const char* key,
                         bool (*is_valid)(const std::string&));

/// The request id of a call; "" when no interceptor of MakeCallInterceptors has
/// seen it and the client sent none.
std::string CallIdOf(const CallMetadata& metadata);

}  // namespace isomatch
