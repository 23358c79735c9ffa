#pragma once

#include <string>

#include <google/protobuf/message.h>
#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/proto_buffer_reader.h>
#include <grpcpp/support/slice.h>

namespace isomatch {

// Messages of methods that gRPC leaves unparsed, so that we can look at them
// first.

/// False when the bytes are no such message.
inline bool ParseRaw(const grpc::ByteBuffer& raw,
                     google::protobuf::Message& message) {
  grpc::ByteBuffer bytes = raw;  // shares them
  grpc::ProtoBufferReader reader(&bytes);
  return reader.status().ok() && message.ParseFromZeroCopyStream(&reader);
}

inline grpc::ByteBuffer SerializeRaw(const google::protobuf::Message& message) {
  const std::string bytes = message.SerializeAsString();
  const grpc::Slice slice(bytes);
  return grpc::ByteBuffer(&slice, 1);
}

}  // namespace isomatch
