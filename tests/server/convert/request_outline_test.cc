#include "server/convert/request_outline.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "google/protobuf/io/zero_copy_stream_impl_lite.h"
#include "isomatch/v1/service.pb.h"
#include "server/jobs/errors.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using google::protobuf::io::ArrayInputStream;
using testing::HasSubstr;

absl::Status Check(const std::string& bytes, int max_fields) {
  // In small pieces, as messages come over the network.
  ArrayInputStream stream(bytes.data(), static_cast<int>(bytes.size()), 7);
  return CheckFieldCount(stream, *v1::CreateJobRequest::descriptor(),
                         max_fields);
}

std::string Repeated(const std::string& text, int count) {
  std::string all;
  for (int i = 0; i < count; ++i) all += text;
  return all;
}

v1::CreateJobRequest FullRequest() {
  v1::CreateJobRequest request;
  request.mutable_mesh_x()->set_draco(Repeated("\x1a", 100));
  request.mutable_mesh_y()->mutable_digest()->set_sha256("ab");
  for (int i = 1; i <= 3; ++i) {
    v1::Landmark& landmark = *request.add_landmarks();
    landmark.set_x(i);
    landmark.set_y(i);
  }
  (*request.mutable_labels())["key"] = "value";
  request.mutable_run_timeout()->set_seconds(5);
  request.set_request_id("the id");
  request.set_validate_only(true);
  return request;
}

TEST(RequestOutlineTest, FieldsAreCountedWithThoseWithin) {
  const std::string bytes = FullRequest().SerializeAsString();
  // 2 of mesh_x, 3 of mesh_y, 9 of landmarks, 3 of labels, 2 of the timeout.
  constexpr int kFields = 21;
  EXPECT_THAT(Check(bytes, kFields), IsOk());
  const absl::Status refused = Check(bytes, kFields - 1);
  EXPECT_EQ(DetailsOf(refused).reason, "INVALID_FIELD");
  EXPECT_THAT(refused.message(), HasSubstr("more than 20 fields"));
}

TEST(RequestOutlineTest, TheFieldThatHasTooManyIsNamed) {
  const auto field = [](const std::string& bytes) {
    return DetailsOf(Check(bytes, 1000)).field;
  };
  EXPECT_EQ(field(Repeated(std::string("\x1a\x00", 2), 1001)), "landmarks");
  EXPECT_EQ(field(Repeated(std::string("\x3a\x00", 2), 1001)), "labels");
  EXPECT_EQ(field(Repeated(std::string("\x72\x00", 2), 1001)), "field 14");
  // Unknown fields within the digest of a mesh.
  const std::string unknown = Repeated(std::string("\x7a\x00", 2), 60);
  const std::string digest = "\x12" + std::string(1, 120) + unknown;
  const std::string mesh = "\x0a" + std::string(1, 122) + digest;
  EXPECT_EQ(field(Repeated(mesh, 20)), "mesh_x");
}

TEST(RequestOutlineTest, WhatIsNoMessageIsRefused) {
  std::string group = "\x63\x64";  // begins and ends field 12
  for (const std::string& bytes :
       {std::string("\x0a\x05xy"), std::string("\xff\xff\xff\xff\xff\xff"),
        std::string("\x1a\x01\x08"), group}) {
    EXPECT_EQ(DetailsOf(Check(bytes, 1000)).field, "request");
  }
  EXPECT_THAT(Check("", 0), IsOk());
}

TEST(RequestOutlineTest, IdAndKindAreRead) {
  const std::string bytes = FullRequest().SerializeAsString();
  ArrayInputStream stream(bytes.data(), static_cast<int>(bytes.size()), 3);
  const RequestOutline outline = ReadOutline(stream);
  EXPECT_EQ(outline.request_id, "the id");
  EXPECT_TRUE(outline.validate_only);
  ArrayInputStream empty(nullptr, 0);
  EXPECT_FALSE(ReadOutline(empty).validate_only);
}

TEST(RequestOutlineTest, AFullRequestOfLandmarksIsNotTooMuch) {
  v1::CreateJobRequest request = FullRequest();
  for (int i = 4; i <= 10'000; ++i) {
    v1::Landmark& landmark = *request.add_landmarks();
    landmark.set_x(i);
    landmark.set_y(i);
  }
  EXPECT_THAT(Check(request.SerializeAsString(), MaxCreateJobFields(10'000)),
              IsOk());
}

}  // namespace
}  // namespace isomatch
