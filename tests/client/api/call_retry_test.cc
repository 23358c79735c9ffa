#include "client/api/call_retry.h"

#include <stop_token>

#include <gtest/gtest.h>

namespace isomatch {
namespace {

absl::StatusCode CodeOfCall(const grpc::Status& status) {
  return OfCall(status, std::stop_token()).code();
}

// nginx does that when it loses the server in the middle of a call.
TEST(OfCallTest, AStreamThatWasResetMayBeTriedAgain) {
  EXPECT_EQ(CodeOfCall({grpc::StatusCode::INTERNAL,
                        "Received RST_STREAM with error code 2"}),
            absl::StatusCode::kUnavailable);
}

TEST(OfCallTest, AnInternalErrorOfTheServiceMayNot) {
  EXPECT_EQ(CodeOfCall({grpc::StatusCode::INTERNAL, "it crashed"}),
            absl::StatusCode::kInternal);
  EXPECT_EQ(CodeOfCall({grpc::StatusCode::INTERNAL, "of RST_STREAM frames",
                        "with details"}),
            absl::StatusCode::kInternal);
}

TEST(OfCallTest, CancelledByTheServerMayBeTriedAgain) {
  EXPECT_EQ(CodeOfCall(grpc::Status::CANCELLED),
            absl::StatusCode::kUnavailable);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(OfCall(grpc::Status::CANCELLED, stop.get_token()).code(),
            absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace isomatch
