#include "server/convert/request_outline.h"

#include <cstdint>

#include "absl/strings/str_cat.h"
#include "google/protobuf/io/coded_stream.h"
#include "google/protobuf/wire_format_lite.h"
#include "isomatch/v1/service.pb.h"
#include "server/jobs/errors.h"

namespace isomatch {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::internal::WireFormatLite;
using google::protobuf::io::CodedInputStream;
using google::protobuf::io::ZeroCopyInputStream;

/// Counts the fields of a message and of those within.
class FieldCounter {
 public:
  enum class End { kOk, kMalformed, kTooMany };

  FieldCounter(CodedInputStream& in, const Descriptor& request, int max_fields)
      : in_(in), request_(request), left_(max_fields) {}

  End Count() { return Count(request_); }

  /// Returns where it ended.
  std::string FieldName() const {
    const int number = WireFormatLite::GetTagFieldNumber(last_tag_);
    const FieldDescriptor* const field = request_.FindFieldByNumber(number);
    return field == nullptr ? absl::StrCat("field ", number) : field->name();
  }

 private:
  End Count(const Descriptor& type) {
    while (const std::uint32_t tag = in_.ReadTag()) {
      if (&type == &request_) last_tag_ = tag;
      if (--left_ < 0) return End::kTooMany;
      const FieldDescriptor* const field =
          type.FindFieldByNumber(WireFormatLite::GetTagFieldNumber(tag));
      const End end = CountWithin(tag, field);
      if (end != End::kOk) return end;
    }
    return in_.ConsumedEntireMessage() ? End::kOk : End::kMalformed;
  }

  End CountWithin(std::uint32_t tag, const FieldDescriptor* field) {
    const auto wire = WireFormatLite::GetTagWireType(tag);
    // Groups, which this API has none of, would hide fields.
    if (wire == WireFormatLite::WIRETYPE_START_GROUP) return End::kMalformed;
    const bool is_message = wire == WireFormatLite::WIRETYPE_LENGTH_DELIMITED &&
                            field != nullptr &&
                            field->type() == FieldDescriptor::TYPE_MESSAGE;
    if (!is_message) {
      return WireFormatLite::SkipField(&in_, tag) ? End::kOk : End::kMalformed;
    }
    std::uint32_t size = 0;
    if (!in_.ReadVarint32(&size)) return End::kMalformed;
    const auto outer = in_.PushLimit(static_cast<int>(size));
    const End end = Count(*field->message_type());
    const bool is_whole = in_.BytesUntilLimit() == 0;
    in_.PopLimit(outer);
    return end == End::kOk && !is_whole ? End::kMalformed : end;
  }

  CodedInputStream& in_;
  const Descriptor& request_;
  int left_;
  /// Tag of the newest field of the request itself, not of a message within.
  std::uint32_t last_tag_ = 0;
};

}  // namespace

absl::Status CheckFieldCount(ZeroCopyInputStream& bytes, const Descriptor& type,
                             int max_fields) {
  CodedInputStream in(&bytes);
  FieldCounter counter(in, type, max_fields);
  switch (counter.Count()) {
    case FieldCounter::End::kOk:
      return absl::OkStatus();
    case FieldCounter::End::kTooMany:
      return InvalidField(
          counter.FieldName(),
          absl::StrCat("with it the request has more than ", max_fields,
                       " fields, those within fields included"));
    case FieldCounter::End::kMalformed:
      break;
  }
  return InvalidField("request",
                      absl::StrCat("expected a message ", type.full_name()));
}

int MaxCreateJobFields(int max_landmarks) {
  constexpr int kOfLandmark = 3;  // itself, x, y
  constexpr int kOthers = 1000;
  return kOfLandmark * max_landmarks + kOthers;
}

RequestOutline ReadOutline(ZeroCopyInputStream& bytes) {
  constexpr std::uint32_t kRequestId =
      WireFormatLite::MakeTag(v1::CreateJobRequest::kRequestIdFieldNumber,
                              WireFormatLite::WIRETYPE_LENGTH_DELIMITED);
  constexpr std::uint32_t kValidateOnly =
      WireFormatLite::MakeTag(v1::CreateJobRequest::kValidateOnlyFieldNumber,
                              WireFormatLite::WIRETYPE_VARINT);
  CodedInputStream in(&bytes);
  RequestOutline outline;
  while (const std::uint32_t tag = in.ReadTag()) {
    std::uint64_t value = 0;
    if (tag == kRequestId) {
      WireFormatLite::ReadString(&in, &outline.request_id);
    } else if (tag == kValidateOnly) {
      in.ReadVarint64(&value);
      outline.validate_only = value != 0;
    } else {
      WireFormatLite::SkipField(&in, tag);
    }
  }
  return outline;
}

}  // namespace isomatch
