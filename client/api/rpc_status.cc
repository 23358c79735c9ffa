#include "client/api/rpc_status.h"

#include <array>
#include <random>

#include "absl/strings/cord.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/types/optional.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace isomatch {
namespace {

/// Type URL of the payload of a status that holds the reason of an error.
constexpr char kReasonUrl[] = "type.googleapis.com/google.rpc.ErrorInfo.reason";

/// Field violations that the message does not tell already.
std::string DescribeViolations(const google::rpc::BadRequest& request,
                               absl::string_view message) {
  std::string text;
  for (const auto& violation : request.field_violations()) {
    if (absl::StrContains(message, violation.description())) continue;
    absl::StrAppend(&text, "; ", violation.field(), ": ",
                    violation.description());
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
  std::string reason;
  google::rpc::Status details;
  (void)details.ParseFromString(status.error_details());
  for (const google::protobuf::Any& detail : details.details()) {
    google::rpc::BadRequest request;
    google::rpc::ErrorInfo info;
    if (detail.UnpackTo(&request)) {
      message += DescribeViolations(request, status.error_message());
    } else if (detail.UnpackTo(&info)) {
      reason = info.reason();
    }
  }
  return WithReason(
      absl::Status(static_cast<absl::StatusCode>(status.error_code()), message),
      reason);
}

absl::Status WithReason(const absl::Status& status, absl::string_view reason) {
  if (reason.empty()) return status;
  absl::Status with(status.code(),
                    absl::StrCat(status.message(), " (", reason, ")"));
  with.SetPayload(kReasonUrl, absl::Cord(reason));
  return with;
}

std::string ErrorReason(const absl::Status& status) {
  const absl::optional<absl::Cord> reason = status.GetPayload(kReasonUrl);
  return reason ? std::string(*reason) : "";
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
