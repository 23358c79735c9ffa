#pragma once

#include <map>
#include <string>

#include <grpcpp/support/string_ref.h>

namespace isomatch {

/// What a client sends with a call, beside its messages.
using CallMetadata = std::multimap<grpc::string_ref, grpc::string_ref>;

inline constexpr char kRequestIdKey[] = "x-request-id";

/// The request id of a call; "" when no interceptor of MakeCallInterceptors has
/// seen it and the client sent none.
std::string CallIdOf(const CallMetadata& metadata);

/// The "traceparent" of W3C Trace Context, version 00, that the client sent:
/// "00-", the trace's 32 hex digits, "-", the span's 16, "-", 2 of flags; ""
/// when it sent none that is right.
std::string TraceParentOf(const CallMetadata& metadata);

}  // namespace isomatch
