// Bytes made to harm, through a real server with the real method: each must be
// refused with reason and field, cost little memory, and leave a server that
// goes on serving.

#include <sys/resource.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/sha256.h"
#include "tests/server/test_server.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::HasSubstr;

constexpr std::int64_t kFewBytes = std::int64_t{64} << 20;

std::int64_t PeakResidentBytes() {
  rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  return std::int64_t{usage.ru_maxrss} * 1024;
}

// Draco 2.2, sequential, byte by byte; counts below 128 are one byte.

std::string Floats(const std::vector<float>& values) {
  return {reinterpret_cast<const char*>(values.data()),
          values.size() * sizeof(float)};
}

/// One attribute of `components` floats that are stored raw.
std::string RawAttribute(char components, const std::string& values) {
  return std::string("\1\1\0\x9", 4) + components + std::string(3, '\0') +
         values;
}

std::string Sequential(char faces, char points, const std::string& indices,
                       const std::string& attributes) {
  return std::string("DRACO\2\2\1\0\0\0", 11) + faces + points + '\1' +
         indices + attributes;
}

std::string Triangle(const std::vector<float>& positions,
                     const std::string& indices = std::string("\0\1\2", 3)) {
  return Sequential(static_cast<char>(indices.size() / 3), 3, indices,
                    RawAttribute(3, Floats(positions)));
}

const std::vector<float> kCorners = {0, 0, 0, 1, 0, 0, 0, 1, 0};

std::string ReadBytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

class HostileMeshTest : public TestServer {
 protected:
  HostileMeshTest() {
    auto created = Server::Create(TestConfig());  // with the real method
    EXPECT_TRUE(created.ok()) << created.status();
    server_ = *std::move(created);
    channel_ = grpc::CreateChannel(server_->address(),
                                   grpc::InsecureChannelCredentials());
    stub_ = v1::CorrespondenceService::NewStub(channel_);
  }

  static v1::CreateJobRequest Request(const std::string& draco) {
    v1::CreateJobRequest request;
    *request.mutable_mesh_x() = ToDraco(Tetrahedron());
    request.mutable_mesh_y()->set_draco(draco);
    return request;
  }

  grpc::Status Create(const v1::CreateJobRequest& request) {
    grpc::ClientContext context;
    v1::CreateJobResponse response;
    return stub_->CreateJob(&context, request, &response);
  }

  v1::Digest Upload(const std::string& bytes) {
    v1::UploadMeshRequest part;
    part.mutable_header()->set_sha256(Sha256Hex(bytes));
    part.mutable_header()->set_size_bytes(bytes.size());
    const v1::Digest digest = part.header();
    grpc::ClientContext context;
    v1::UploadMeshResponse response;
    const auto writer = stub_->UploadMesh(&context, &response);
    writer->Write(part);
    part.set_chunk(bytes);
    writer->Write(part);
    writer->WritesDone();
    EXPECT_TRUE(writer->Finish().ok());
    return digest;
  }

  void ExpectRefused(const grpc::Status& status, const std::string& field,
                     const std::string& why) {
    const CallError error = ErrorOf(status);
    EXPECT_EQ(error.code, grpc::StatusCode::INVALID_ARGUMENT) << why;
    EXPECT_EQ(error.reason, "MESH_MALFORMED") << why;
    // Of the bytes, or of the mesh that they hold.
    EXPECT_TRUE(error.field == field || error.field == "mesh_y") << why;
    EXPECT_THAT(status.error_message(), HasSubstr(why));
  }

  /// Inline and uploaded.
  void ExpectRefused(const std::string& draco, const std::string& why) {
    const std::int64_t before = PeakResidentBytes();
    v1::CreateJobRequest request = Request(draco);
    ExpectRefused(Create(request), "mesh_y.draco", why);
    *request.mutable_mesh_y()->mutable_digest() = Upload(draco);
    ExpectRefused(Create(request), "mesh_y.digest", why);
    EXPECT_LT(PeakResidentBytes() - before, kFewBytes) << why;
  }

  void ExpectServes() {
    const std::string name = CreateJob();
    EXPECT_EQ(Watch(name).back().state(), v1::Job::STATE_SUCCEEDED);
  }
};

TEST_F(HostileMeshTest, ATriangleOfTheseBytesIsAccepted) {
  const grpc::Status status = Create(Request(Triangle(kCorners)));
  EXPECT_TRUE(status.ok()) << status.error_message();
}

TEST_F(HostileMeshTest, BombsAreRefusedWithLittleMemory) {
  // 100 million faces in 150 bytes, by edgebreaker and sequentially.
  std::string bomb("DRACO\2\2\1\1\0\0\0\x90\x4e\x80\xc2\xd7\x2f\1", 19);
  bomb.resize(150, '\x55');
  ExpectRefused(bomb, "claims 100000000 faces");
  bomb = std::string("DRACO\2\2\1\0\0\0\x80\xc2\xd7\x2f\x90\x4e\1", 18);
  bomb.resize(150, '\x55');
  ExpectRefused(bomb, "claims 100000000 faces");
  // Attributes of 255 doubles, 200 of them, over the 100 points.
  std::string wide = "\1\xc8\1";
  wide.pop_back();
  for (int i = 0; i < 200; ++i) wide += std::string("\4\xa\xff\0", 4) + char(i);
  ExpectRefused(Sequential(1, 100, std::string("\0\1\2", 3), wide), "");
  ExpectServes();
}

TEST_F(HostileMeshTest, WhatIsNoMeshIsRefused) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  const std::string indices("\0\1\2", 3);
  ExpectRefused("", "");
  ExpectRefused("DRACO", "");
  ExpectRefused(std::string(1 << 20, '\xff'), "not a Draco stream");
  ExpectRefused(Triangle(kCorners, std::string("\0\1\7", 3)), "vertex 7");
  ExpectRefused(Triangle({0, 0, 0, 1, nan, 0, 0, 1, 0}), "vertex 1");
  ExpectRefused(Triangle({0, 0, 0, 1, inf, 0, 0, 1, 0}), "vertex 1");
  ExpectRefused(Triangle(kCorners, ""), "");
  ExpectRefused(Sequential(1, 3, indices, std::string("\0", 1)),
                "no POSITION attribute");
  ExpectRefused(
      Sequential(1, 3, indices, RawAttribute(2, Floats({0, 0, 1, 0, 0, 1}))),
      "no POSITION attribute");
  ExpectRefused(Sequential(0, 1, "", RawAttribute(3, Floats({0, 0, 0}))), "");
  ExpectServes();
}

TEST_F(HostileMeshTest, NothingOfTheFuzzersCorpusHarms) {
  const std::int64_t before = PeakResidentBytes();
  for (const auto& entry :
       std::filesystem::directory_iterator(ISOMATCH_DRACO_CORPUS)) {
    // The fuzzer's first byte chooses options; both readings are bytes to try.
    const std::string bytes = ReadBytes(entry.path());
    for (const std::string& draco : {bytes, bytes.substr(1)}) {
      const grpc::Status status = Create(Request(draco));
      if (!status.ok()) {
        EXPECT_EQ(ErrorOf(status).reason, "MESH_MALFORMED") << entry.path();
      }
    }
  }
  EXPECT_LT(PeakResidentBytes() - before, kFewBytes);
  ExpectServes();
}

TEST_F(HostileMeshTest, DegenerateMeshesEndInAnAnswer) {
  const std::vector<float> one_point(9, 0.0F);
  for (const std::string& draco :
       {Triangle(kCorners), Triangle(one_point),
        Triangle(kCorners, std::string("\1\1\1", 3)),
        Triangle({0, 0, 0, 3e38F, 0, 0, 0, 3e38F, 0}),
        Triangle({0, 0, 0, 1e-45F, 0, 0, 0, 1e-45F, 0})}) {
    grpc::ClientContext context;
    v1::CreateJobResponse response;
    const grpc::Status status =
        stub_->CreateJob(&context, Request(draco), &response);
    if (!status.ok()) {
      EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
      continue;
    }
    const v1::Job job = Watch(response.job().name()).back();
    if (job.state() == v1::Job::STATE_SUCCEEDED) continue;
    EXPECT_EQ(job.state(), v1::Job::STATE_FAILED);
    EXPECT_NE(job.error().reason(), "INTERNAL") << job.error().message();
  }
  ExpectServes();
}

TEST_F(HostileMeshTest, LandmarksAreCheckedAgainstTheMeshes) {
  v1::CreateJobRequest request = Request(Triangle(kCorners));
  v1::Landmark* landmark = request.add_landmarks();
  landmark->set_x(4);
  EXPECT_EQ(CreateError(request).field, "landmarks[0].x");
  landmark->set_x(0);
  landmark->set_y(0xFFFFFFFF);
  EXPECT_EQ(CreateError(request).field, "landmarks[0].y");
  EXPECT_EQ(CreateError(request).reason, "MATCH_OUT_OF_RANGE");
  landmark->set_y(0);
  *request.add_landmarks() = *landmark;
  EXPECT_EQ(CreateError(request).reason, "LANDMARKS_CONTRADICT");
  request.mutable_landmarks(1)->set_x(1);
  EXPECT_EQ(CreateError(request).reason, "LANDMARKS_CONTRADICT");
  EXPECT_EQ(CreateError(request).field, "landmarks[1].y");
}

TEST_F(HostileMeshTest, LandmarksOnNoFaceAreRefused) {
  TriangleMesh mesh = UnitSphere(2);
  const VertexIndex isolated = mesh.num_vertices();
  mesh.positions.conservativeResize(isolated + 1, Eigen::NoChange);
  mesh.positions.bottomRows(1).setOnes();
  v1::CreateJobRequest request;
  *request.mutable_mesh_x() = ToDraco(mesh);
  *request.mutable_mesh_y() = ToDraco(mesh);
  v1::Landmark* landmark = request.add_landmarks();
  landmark->set_x(static_cast<std::uint32_t>(isolated));
  EXPECT_EQ(CreateError(request).reason, "INVALID_FIELD");
  EXPECT_EQ(CreateError(request).field, "landmarks[0].x");
  landmark->set_x(0);
  landmark->set_y(static_cast<std::uint32_t>(isolated));
  EXPECT_EQ(CreateError(request).field, "landmarks[0].y");
}

TEST_F(HostileMeshTest, AJobBeyondTheBudgetIsRefusedWithNumbers) {
  ServerConfig config = TestConfig();
  config.memory_budget_bytes = std::int64_t{16} << 20;
  config.prepared_cache_bytes = 0;
  auto small = Server::Create(config);
  ASSERT_TRUE(small.ok()) << small.status();
  const auto stub =
      v1::CorrespondenceService::NewStub((*small)->InProcessChannel());
  grpc::ClientContext info_context;
  v1::GetServerInfoResponse info;
  ASSERT_TRUE(stub->GetServerInfo(&info_context, {}, &info).ok());
  EXPECT_EQ(info.limits().max_mesh_bytes(), 1 << 20);
  EXPECT_EQ(info.limits().max_request_bytes(), 1 << 19);
  EXPECT_EQ(info.limits().max_chunk_bytes(), 1 << 18);
  // Meshes that can be read but not matched, and some that cannot be read.
  for (const auto& [levels, why] :
       {std::pair(4, "the server has 16777216"),
        std::pair(5, "reading the meshes may need")}) {
    v1::CreateJobRequest request;
    *request.mutable_mesh_x() = ToDraco(UnitSphere(levels));
    *request.mutable_mesh_y() = ToDraco(UnitSphere(levels));
    grpc::ClientContext context;
    v1::CreateJobResponse response;
    const grpc::Status status = stub->CreateJob(&context, request, &response);
    const CallError error = ErrorOf(status);
    EXPECT_EQ(error.code, grpc::StatusCode::FAILED_PRECONDITION);
    EXPECT_EQ(error.reason, "JOB_NEEDS_MORE_MEMORY_THAN_BUDGET");
    EXPECT_THAT(status.error_message(), HasSubstr(why));
  }
}

TEST_F(HostileMeshTest, WrongOptionsAreNamed) {
  v1::CreateJobRequest request = SphereJob();
  request.mutable_options()->set_profile(static_cast<v1::Profile>(77));
  EXPECT_EQ(CreateError(request).field, "options.profile");
  request = SphereJob();
  request.mutable_options()->set_threads(0xFFFFFFFF);
  EXPECT_EQ(CreateError(request).field, "options.threads");
  request = SphereJob();
  request.mutable_options()->set_relation(static_cast<v1::Relation>(9));
  EXPECT_EQ(CreateError(request).field, "options.relation");
  request.mutable_options()->set_relation(v1::RELATION_PART_OF_Y);
  request.mutable_options()->set_profile(v1::PROFILE_PAPER);
  EXPECT_EQ(CreateError(request).field, "options.relation");
  request = SphereJob();
  request.mutable_options()->set_scale(static_cast<v1::LengthScale>(9));
  EXPECT_EQ(CreateError(request).field, "options.scale");
  request.mutable_options()->set_scale(v1::LENGTH_SCALE_SAME);
  EXPECT_EQ(CreateError(request).field, "options.scale");
  request = SphereJob();
  request.mutable_run_timeout()->set_seconds(-1);
  EXPECT_EQ(CreateError(request).field, "run_timeout");
  request = SphereJob();
  request.mutable_mesh_x()->set_vertex_count(0xFFFFFFFF);
  EXPECT_EQ(CreateError(request).field, "mesh_x.vertex_count");
  request.clear_mesh_x();
  EXPECT_EQ(CreateError(request).field, "mesh_x");
}

TEST_F(HostileMeshTest, FewerThreadsThanAskedForIsAWarning) {
  v1::CreateJobRequest request = SphereJob();
  request.mutable_options()->set_threads(1024);
  const v1::Job job = Watch(CreateJob(request)).back();
  EXPECT_THAT(job.result().warnings(),
              testing::Contains(HasSubstr("1024 were asked for")));
}

}  // namespace
}  // namespace isomatch
