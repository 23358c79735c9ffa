#include "server/rpc/raw_message.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "core/base/sha256.h"
#include "isomatch/v1/service.pb.h"
#include "tests/server/test_server.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::HasSubstr;

/// Fields that no message has: two bytes each, kept when they are parsed.
std::string UnknownFields(int count) {
  std::string bytes;
  for (int i = 0; i < count; ++i) bytes += std::string("\x7a\x00", 2);
  return bytes;
}

grpc::ByteBuffer BufferOf(const std::string& bytes) {
  const grpc::Slice slice(bytes);
  return grpc::ByteBuffer(&slice, 1);
}

TEST(RawMessageTest, WhatIsWithinTheBoundsIsParsed) {
  v1::GetJobRequest request;
  request.set_name("jobs/1");
  v1::GetJobRequest parsed;
  EXPECT_THAT(ParseWithin({8, 1}, SerializeRaw(request), parsed), IsOk());
  EXPECT_EQ(parsed.name(), "jobs/1");
  EXPECT_THAT(
      ParseWithin(kSmallRequest, SerializeRaw(v1::GetJobRequest()), parsed),
      IsOk());
  EXPECT_EQ(parsed.name(), "");
}

TEST(RawMessageTest, WhatIsNotIsRefusedWithWhatWasAllowed) {
  v1::GetJobRequest parsed;
  EXPECT_THAT(ParseWithin({9, 5}, BufferOf(UnknownFields(5)), parsed),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("10 bytes, expected at most 9")));
  EXPECT_THAT(ParseWithin({10, 4}, BufferOf(UnknownFields(5)), parsed),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("more than 4 fields")));
  EXPECT_THAT(ParseWithin({10, 5}, BufferOf(UnknownFields(5)), parsed), IsOk());
  EXPECT_THAT(ParseWithin({10, 5}, BufferOf("\xff"), parsed),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("isomatch.v1.GetJobRequest")));
}

TEST(RawMessageTest, TakenBytesAreGoneFromTheRequest) {
  const grpc::ByteBuffer request = BufferOf("bytes");
  EXPECT_EQ(TakeBytes(&request).Length(), 5);
  EXPECT_EQ(request.Length(), 0);
}

/// Of a whole server.
class RawRequestsTest : public TestServer {
 protected:
  struct Method {
    std::string name;
    /// Fields that it takes of any kind.
    int max_fields;
  };

  static std::vector<Method> Methods() {
    return {{"GetServerInfo", 100}, {"UploadMesh", 8},
            {"CreateJob", 31'000},  {"FindMissingMeshes", 3'300},
            {"GetJob", 100},        {"WatchJob", 100},
            {"ListJobs", 2'048},    {"CancelJob", 100},
            {"DeleteJob", 100},     {"DownloadResult", 100}};
  }

  RawRequestsTest() {
    ServerConfig config = TestConfig();
    config.api_keys = folder_.Write(
        "keys", absl::StrCat("alice alice submit ", Sha256Hex("key"), "\n"));
    Restart(config);
  }

  /// Streams answer as calls of one message, when they are refused.
  CallError Call(const std::string& method, const std::string& bytes,
                 const std::string& key = "key") {
    return CallPath("/isomatch.v1.CorrespondenceService/" + method, bytes, key);
  }

  CallError CallPath(const std::string& path, const std::string& bytes,
                     const std::string& key) {
    grpc::ClientContext context;
    context.AddMetadata("api-key", key);
    grpc::GenericStub stub(channel_);
    grpc::CompletionQueue queue;
    const auto call =
        stub.PrepareUnaryCall(&context, path, BufferOf(bytes), &queue);
    call->StartCall();
    grpc::Status status;
    response_.Clear();
    call->Finish(&response_, &status, nullptr);
    void* tag = nullptr;
    bool ok = false;
    queue.Next(&tag, &ok);
    message_ = status.error_message();
    return ErrorOf(status);
  }

  const TemporaryFolder folder_;
  std::string message_;
  grpc::ByteBuffer response_;
};

TEST_F(RawRequestsTest, UnknownFieldsAreCountedByEveryMethod) {
  for (const auto& [name, max_fields] : Methods()) {
    const CallError error = Call(name, UnknownFields(max_fields + 1));
    EXPECT_EQ(error.reason, "INVALID_FIELD") << name;
    EXPECT_EQ(error.field, "field 15") << name;
    EXPECT_THAT(message_, HasSubstr(absl::StrCat(max_fields))) << name;
    (void)Call(name, UnknownFields(max_fields));
    EXPECT_THAT(message_, testing::Not(HasSubstr("fields"))) << name;
  }
}

TEST_F(RawRequestsTest, LargeRequestsAreRefusedUnparsed) {
  const std::string bytes = UnknownFields(2'000'000);
  for (const auto& [name, max_fields] : Methods()) {
    EXPECT_EQ(Call(name, bytes).reason, "INVALID_FIELD") << name;
    EXPECT_EQ(Call(name, bytes, "none").reason, "API_KEY_WRONG") << name;
  }
}

TEST_F(RawRequestsTest, AHeaderOfAnUploadIsSmall) {
  v1::UploadMeshRequest request;
  request.mutable_header()->set_sha256(std::string(100'000, 'a'));
  EXPECT_EQ(Call("UploadMesh", request.SerializeAsString()).reason,
            "UPLOAD_MALFORMED");
  EXPECT_THAT(message_, HasSubstr("expected at most 4096"));
}

TEST_F(RawRequestsTest, ReflectionKeepsNothingLarge) {
  const std::string path =
      "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo";
  const std::string list = std::string("\x3a\x00", 2);  // the services
  EXPECT_EQ(CallPath(path, list, "").code, grpc::StatusCode::OK);
  EXPECT_GT(response_.Length(), 50);
  // An answer repeats its request.
  EXPECT_EQ(CallPath(path, list + UnknownFields(1'000'000), "").code,
            grpc::StatusCode::OK);
  EXPECT_GT(response_.Length(), 0);
  EXPECT_LT(response_.Length(), 1000);
}

}  // namespace
}  // namespace isomatch
