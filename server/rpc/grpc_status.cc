#include "server/rpc/grpc_status.h"

#include <string>

#include "absl/time/time.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "server/jobs/errors.h"

namespace isomatch {
namespace {

constexpr char kDomain[] = "isomatch";

google::rpc::ErrorInfo MakeErrorInfo(const ErrorDetails& details) {
  google::rpc::ErrorInfo info;
  info.set_reason(details.reason);
  info.set_domain(kDomain);
  info.mutable_metadata()->insert(details.metadata.begin(),
                                  details.metadata.end());
  return info;
}

google::rpc::BadRequest MakeBadRequest(const std::string& field,
                                       const std::string& description) {
  google::rpc::BadRequest bad_request;
  auto& violation = *bad_request.add_field_violations();
  violation.set_field(field);
  violation.set_description(description);
  return bad_request;
}

google::rpc::RetryInfo MakeRetryInfo(absl::Duration delay) {
  google::rpc::RetryInfo info;
  auto& proto = *info.mutable_retry_delay();
  proto.set_seconds(absl::IDivDuration(delay, absl::Seconds(1), &delay));
  proto.set_nanos(static_cast<std::int32_t>(absl::ToInt64Nanoseconds(delay)));
  return info;
}

}  // namespace

grpc::Status ToGrpc(const absl::Status& status) {
  if (status.ok()) return grpc::Status::OK;
  const ErrorDetails details = DetailsOf(status);
  const std::string message(status.message());
  google::rpc::Status proto;
  proto.set_code(static_cast<int>(status.code()));
  proto.set_message(message);
  proto.add_details()->PackFrom(MakeErrorInfo(details));
  if (!details.field.empty()) {
    proto.add_details()->PackFrom(MakeBadRequest(details.field, message));
  }
  if (details.retry_after) {
    proto.add_details()->PackFrom(MakeRetryInfo(*details.retry_after));
  }
  return {static_cast<grpc::StatusCode>(status.code()), message,
          proto.SerializeAsString()};
}

}  // namespace isomatch
