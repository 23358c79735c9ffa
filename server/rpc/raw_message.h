#pragma once

#include <cstddef>

#include <google/protobuf/message.h>
#include <grpcpp/support/byte_buffer.h>

#include "absl/status/status.h"

namespace isomatch {

// Messages of methods that gRPC leaves unparsed, so that we can look at them
// first.

/// False when the bytes are no such message.
bool ParseRaw(const grpc::ByteBuffer& raw, google::protobuf::Message& message);

grpc::ByteBuffer SerializeRaw(const google::protobuf::Message& message);

/// Takes the bytes out of a request that a handler was given. gRPC keeps the
/// request as long as the call runs, though nobody else reads it.
grpc::ByteBuffer TakeBytes(const grpc::ByteBuffer* request);

/// How large a message may be to be parsed: parsed, each field takes about 100
/// bytes beside those that came, also one that nobody knows.
struct RawBounds {
  std::size_t max_bytes;
  /// Fields of the message and of all messages in it.
  int max_fields;
};

/// Bounds of a request that names a job, or nothing.
inline constexpr RawBounds kSmallRequest = {4 << 10, 100};

/// Parses `raw` if it is within the bounds. INVALID_ARGUMENT (INVALID_FIELD)
/// names the field of which there are too many, or "request".
absl::Status ParseWithin(const RawBounds& bounds, const grpc::ByteBuffer& raw,
                         google::protobuf::Message& message);

}  // namespace isomatch
