#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "google/protobuf/descriptor.h"
#include "google/protobuf/io/zero_copy_stream.h"

namespace isomatch {

// What can be known of a request before it is parsed. Parsed, a message takes
// up to forty times the bytes that came: two bytes are an empty message, which
// is an object of its own. So fields are counted first.

/// OK when `bytes` has at most `max_fields` fields, those of its messages
/// included; parsed it takes at most its bytes and about 100 for each of them.
/// INVALID_ARGUMENT (INVALID_FIELD) names the field of the request where they
/// are too many, or "request" when the bytes are no message. O(bytes), without
/// memory.
absl::Status CheckFieldCount(google::protobuf::io::ZeroCopyInputStream& bytes,
                             const google::protobuf::Descriptor& type,
                             int max_fields);

/// How many fields a CreateJob request may have: those of the landmarks and
/// some for all else.
int MaxCreateJobFields(int max_landmarks);

/// What has to be known of a CreateJob request before it has its turn.
struct RequestOutline {
  std::string request_id;
  bool validate_only = false;
};

/// REQUIRES: CheckFieldCount is OK.
RequestOutline ReadOutline(google::protobuf::io::ZeroCopyInputStream& bytes);

}  // namespace isomatch
