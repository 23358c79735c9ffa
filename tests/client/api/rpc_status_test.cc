#include "client/api/rpc_status.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace isomatch {
namespace {

using testing::EndsWith;
using testing::IsEmpty;

grpc::Status Refused(const std::string& message, const std::string& reason) {
  google::rpc::Status details;
  google::rpc::BadRequest request;
  google::rpc::BadRequest::FieldViolation* violation =
      request.add_field_violations();
  violation->set_field("options.threads");
  violation->set_description("is 9, expected 0 to 8");
  details.add_details()->PackFrom(request);
  google::rpc::ErrorInfo info;
  info.set_reason(reason);
  details.add_details()->PackFrom(info);
  return {grpc::StatusCode::INVALID_ARGUMENT, message,
          details.SerializeAsString()};
}

TEST(RpcStatusTest, ReasonAndViolationsAreTold) {
  const absl::Status status = FromGrpc(Refused("wrong", "INVALID_FIELD"));
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(status.message(),
            "wrong; options.threads: is 9, expected 0 to 8 (INVALID_FIELD)");
  EXPECT_EQ(ErrorReason(status), "INVALID_FIELD");
}

TEST(RpcStatusTest, WordsOfTheMessageAreNoReason) {
  const absl::Status status =
      FromGrpc(Refused("label '(QUEUE_FULL)'", "INVALID_FIELD"));
  EXPECT_EQ(ErrorReason(status), "INVALID_FIELD");
  const grpc::Status plain(grpc::StatusCode::UNAVAILABLE, "a (QUEUE_FULL)");
  EXPECT_THAT(ErrorReason(FromGrpc(plain)), IsEmpty());
  EXPECT_THAT(ErrorReason(absl::OkStatus()), IsEmpty());
}

TEST(RpcStatusTest, AReasonThatIsNoneAddsNothing) {
  const absl::Status error = absl::InternalError("lost");
  EXPECT_EQ(WithReason(error, ""), error);
  EXPECT_THAT(std::string(WithReason(error, "CRASHED").message()),
              EndsWith("lost (CRASHED)"));
}

}  // namespace
}  // namespace isomatch
