// Compressed requests of strangers, against the real server.

#include <cstdint>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "tests/server/child_process.h"

namespace isomatch {
namespace {

using testing::HasSubstr;

constexpr char kGetServerInfo[] =
    "/isomatch.v1.CorrespondenceService/GetServerInfo";

/// Peak resident memory of a process.
std::int64_t PeakBytes(pid_t process) {
  std::ifstream status(absl::StrCat("/proc/", process, "/status"));
  std::string word;
  std::int64_t kibibytes = 0;
  while (status >> word) {
    if (word == "VmHWM:" && status >> kibibytes) return kibibytes << 10;
  }
  ADD_FAILURE() << "no VmHWM: has the server ended?";
  return 0;
}

/// Zeros, which take no memory of this process.
grpc::ByteBuffer Zeros(int mebibytes) {
  const grpc::Slice zeros(std::string(std::size_t{1} << 20, '\0'));
  const std::vector<grpc::Slice> slices(mebibytes, zeros);
  return {slices.data(), slices.size()};
}

grpc::Status Send(grpc::GenericStub& stub, const grpc::ByteBuffer& request,
                  grpc_compression_algorithm algorithm) {
  grpc::ClientContext context;
  context.set_compression_algorithm(algorithm);
  grpc::CompletionQueue queue;
  const auto call =
      stub.PrepareUnaryCall(&context, kGetServerInfo, request, &queue);
  call->StartCall();
  grpc::ByteBuffer response;
  grpc::Status status;
  call->Finish(&response, &status, nullptr);
  void* tag = nullptr;
  bool ok = false;
  queue.Next(&tag, &ok);
  return status;
}

class CompressionTest
    : public testing::TestWithParam<grpc_compression_algorithm> {
 protected:
  ServerProcess server_{ISOMATCH_SERVER_BINARY};
  grpc::GenericStub stub_{
      grpc::CreateChannel(server_.address, grpc::InsecureChannelCredentials())};
};

// 96 MiB of zeros are 96 KiB on the wire, less than a request may have.
TEST_P(CompressionTest, ABombIsNotUnpacked) {
  const std::int64_t before = PeakBytes(server_.process.id());
  EXPECT_FALSE(Send(stub_, Zeros(96), GetParam()).ok());
  const std::int64_t growth = PeakBytes(server_.process.id()) - before;
  RecordProperty("growth_mib", static_cast<int>(growth >> 20));
  EXPECT_LT(growth, std::int64_t{32} << 20);
  EXPECT_TRUE(Send(stub_, Zeros(0), GRPC_COMPRESS_NONE).ok());
}

TEST_P(CompressionTest, WhoCompressesIsToldThatItIsRefused) {
  const grpc::Status status = Send(stub_, Zeros(1), GetParam());
  EXPECT_EQ(status.error_code(), grpc::StatusCode::UNIMPLEMENTED);
  EXPECT_THAT(status.error_message(),
              HasSubstr(GetParam() == GRPC_COMPRESS_GZIP ? "gzip" : "deflate"));
}

INSTANTIATE_TEST_SUITE_P(Algorithms, CompressionTest,
                         testing::Values(GRPC_COMPRESS_GZIP,
                                         GRPC_COMPRESS_DEFLATE));

}  // namespace
}  // namespace isomatch
