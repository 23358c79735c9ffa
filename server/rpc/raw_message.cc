#include "server/rpc/raw_message.h"

#include <string>

#include <grpcpp/support/proto_buffer_reader.h>
#include <grpcpp/support/slice.h>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/convert/request_outline.h"
#include "server/jobs/errors.h"

namespace isomatch {

bool ParseRaw(const grpc::ByteBuffer& raw, google::protobuf::Message& message) {
  grpc::ByteBuffer bytes = raw;  // shares them
  grpc::ProtoBufferReader reader(&bytes);
  return reader.status().ok() && message.ParseFromZeroCopyStream(&reader);
}

grpc::ByteBuffer SerializeRaw(const google::protobuf::Message& message) {
  const std::string bytes = message.SerializeAsString();
  const grpc::Slice slice(bytes);
  return grpc::ByteBuffer(&slice, 1);
}

grpc::ByteBuffer TakeBytes(const grpc::ByteBuffer* request) {
  grpc::ByteBuffer bytes;
  bytes.Swap(const_cast<grpc::ByteBuffer*>(request));
  return bytes;
}

absl::Status ParseWithin(const RawBounds& bounds, const grpc::ByteBuffer& raw,
                         google::protobuf::Message& message) {
  if (raw.Length() > bounds.max_bytes) {
    return InvalidField("request",
                        absl::StrCat(raw.Length(), " bytes, expected at most ",
                                     bounds.max_bytes));
  }
  grpc::ByteBuffer bytes = raw;  // shares them
  grpc::ProtoBufferReader reader(&bytes);
  ISOMATCH_RETURN_IF_ERROR(
      CheckFieldCount(reader, *message.GetDescriptor(), bounds.max_fields));
  if (ParseRaw(raw, message)) return absl::OkStatus();
  return InvalidField("request",
                      absl::StrCat("expected a message ",
                                   message.GetDescriptor()->full_name()));
}

}  // namespace isomatch
