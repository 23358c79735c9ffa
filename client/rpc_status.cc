#include "client/rpc_status.h"

#include <array>
#include <random>

#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace isomatch {
namespace {

// Field violations that the message does not tell already, then the reason.
std::string DescribeDetails(const google::rpc::Status& status,
                            absl::string_view message) {
  std::string text;
  for (const google::protobuf::Any& detail : status.details()) {
    google::rpc::BadRequest bad_request;
    google::rpc::ErrorInfo info;
    if (detail.UnpackTo(&bad_request)) {
      for (const auto& violation : bad_request.field_violations()) {
        if (absl::StrContains(message, violation.description())) continue;
        absl::StrAppend(&text, "; ", violation.field(), ": ",
                        violation.description());
      }
    } else if (detail.UnpackTo(&info) && !info.reason().empty()) {
      absl::StrAppend(&text, " (", info.reason(), ")");
    }
  }
  return text;
}

std::string ToHex(const unsigned char* bytes, std::size_t size) {
  return absl::BytesToHexString(
      absl::string_view(reinterpret_cast<const char*>(bytes), size));
}

}  // namespace

absl::Status FromGrpc(const grpc::Status& status) {
  if (status.ok()) return absl::OkStatus();
  std::string message = status.error_message();
  google::rpc::Status details;
  if (details.ParseFromString(status.error_details())) {
    absl::StrAppend(&message, DescribeDetails(details, message));
  }
  return absl::Status(static_cast<absl::StatusCode>(status.error_code()),
                      message);
}

std::string RandomUuid() {
  std::random_device device;
  std::array<unsigned char, 16> bytes;
  for (unsigned char& byte : bytes) {
    byte = static_cast<unsigned char>(device());
  }
  bytes[6] = (bytes[6] & 0x0f) | 0x40;  // version 4
  bytes[8] = (bytes[8] & 0x3f) | 0x80;  // variant of RFC 4122
  const std::string hex = ToHex(bytes.data(), bytes.size());
  return absl::StrCat(hex.substr(0, 8), "-", hex.substr(8, 4), "-",
                      hex.substr(12, 4), "-", hex.substr(16, 4), "-",
                      hex.substr(20));
}

}  // namespace isomatch
