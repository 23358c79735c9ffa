#include "server/convert/parse_create_job.h"

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/base/sha256.h"
#include "core/io/draco_mesh.h"
#include "core/mesh/mesh_size.h"
#include "server/convert/request_limits.h"
#include "server/convert/stored_request.h"
#include "server/jobs/errors.h"
#include "server/storage/memory_blob_store.h"
#include "tests/server/test_server.h"
#include "tests/support/draco_stream.h"
#include "tests/support/shapes.h"
#include "tests/support/unprepared_engine.h"

namespace isomatch {
namespace {

constexpr auto kBadRequest = grpc::StatusCode::INVALID_ARGUMENT;

/// CreateJob with bad requests: each is refused with its field, and the server
/// goes on serving.
class ParseCreateJobTest : public TestServer {
 protected:
  void ExpectRefused(const v1::CreateJobRequest& request,
                     const std::string& reason, const std::string& field) {
    const CallError error = CreateError(request);
    EXPECT_EQ(error.code, kBadRequest);
    EXPECT_EQ(error.reason, reason);
    EXPECT_EQ(error.field, field);
    EXPECT_NE(CreateJob(), "");
  }
};

TEST_F(ParseCreateJobTest, BytesThatAreNotDraco) {
  v1::CreateJobRequest request = SphereJob();
  request.mutable_mesh_y()->set_draco("DRACO and then nonsense");
  ExpectRefused(request, "MESH_MALFORMED", "mesh_y.draco");
}

TEST_F(ParseCreateJobTest, DracoThatWasCutShort) {
  v1::CreateJobRequest request = SphereJob();
  std::string& bytes = *request.mutable_mesh_x()->mutable_draco();
  bytes.resize(bytes.size() / 2);
  ExpectRefused(request, "MESH_MALFORMED", "mesh_x.draco");
}

TEST_F(ParseCreateJobTest, AnotherNumberOfVerticesThanSaid) {
  v1::CreateJobRequest request = SphereJob();
  request.mutable_mesh_x()->set_vertex_count(7);
  ExpectRefused(request, "MESH_MALFORMED", "mesh_x.draco");
  request.mutable_mesh_x()->set_vertex_count(4'000'000'000);
  ExpectRefused(request, "INVALID_FIELD", "mesh_x.vertex_count");
}

TEST_F(ParseCreateJobTest, NoMeshAtAll) {
  v1::CreateJobRequest request = SphereJob();
  request.clear_mesh_y();
  ExpectRefused(request, "INVALID_FIELD", "mesh_y");
}

TEST_F(ParseCreateJobTest, ACoordinateThatIsNotANumber) {
  TriangleMesh mesh = UnitSphere(1);
  mesh.positions(3, 1) = std::numeric_limits<double>::quiet_NaN();
  v1::CreateJobRequest request = SphereJob();
  *request.mutable_mesh_x() = ToDraco(mesh);
  const CallError error = CreateError(request);
  EXPECT_EQ(error.code, kBadRequest);
  EXPECT_EQ(error.reason, "MESH_MALFORMED");
  EXPECT_THAT(error.field, testing::StartsWith("mesh_x"));
}

TEST_F(ParseCreateJobTest, ADigestOfAnotherSizeThanItsMesh) {
  v1::CreateJobRequest request = SphereJob();
  CreateJob(request);  // its meshes are known by digest now
  const std::string bytes = request.mesh_x().draco();
  v1::Digest& digest = *request.mutable_mesh_x()->mutable_digest();
  digest.set_sha256(Sha256Hex(bytes));
  digest.set_size_bytes(bytes.size() + 1);
  ExpectRefused(request, "INVALID_FIELD", "mesh_x.digest.size_bytes");
}

TEST_F(ParseCreateJobTest, MoreLandmarksThanAllowed) {
  v1::CreateJobRequest request = SphereJob();
  for (int i = 0; i <= RequestLimits().max_landmarks; ++i) {
    request.add_landmarks();
  }
  ExpectRefused(request, "INVALID_FIELD", "landmarks");
}

TEST_F(ParseCreateJobTest, LandmarksOutOfRange) {
  v1::CreateJobRequest request = SphereJob();
  request.add_landmarks()->set_x(41);
  request.add_landmarks()->set_x(42);  // of 42 vertices
  ExpectRefused(request, "MATCH_OUT_OF_RANGE", "landmarks[1].x");
  request.mutable_landmarks(1)->set_x(0);
  request.mutable_landmarks(1)->set_y(4'294'967'295U);
  ExpectRefused(request, "MATCH_OUT_OF_RANGE", "landmarks[1].y");
}

TEST_F(ParseCreateJobTest, LandmarksThatContradict) {
  v1::CreateJobRequest request = SphereJob();
  request.add_landmarks()->set_y(1);
  request.add_landmarks()->set_y(2);
  ExpectRefused(request, "LANDMARKS_CONTRADICT", "landmarks[1].x");
}

TEST_F(ParseCreateJobTest, OptionsOutOfRange) {
  v1::CreateJobRequest request = SphereJob();
  request.mutable_options()->set_threads(1025);
  ExpectRefused(request, "INVALID_FIELD", "options.threads");
  request = SphereJob();
  request.mutable_options()->set_profile(static_cast<v1::Profile>(9));
  ExpectRefused(request, "INVALID_FIELD", "options.profile");
  request = SphereJob();
  request.mutable_mesh_x()->set_vertex_order(static_cast<v1::VertexOrder>(9));
  ExpectRefused(request, "INVALID_FIELD", "mesh_x.vertex_order");
}

/// Of the result of `request`.
MATCHER_P(WarnsOnlyOf, field, "") {
  const auto& warnings = arg.result().warnings();
  return warnings.size() == 1 &&
         absl::StartsWith(warnings[0],
                          absl::StrCat(field, ": vertex_order ")) &&
         absl::StrContains(warnings[0], "VERTEX_ORDER_ID_ATTRIBUTE");
}

TEST_F(ParseCreateJobTest, EdgebreakerWithoutAnOrderIsAWarning) {
  v1::CreateJobRequest request = SphereJob();
  ASSERT_TRUE(RenumbersVertices(request.mesh_x().draco()));
  EXPECT_THAT(Watch(CreateJob(request)).back().result().warnings(),
              testing::IsEmpty());
  request.mutable_mesh_x()->clear_vertex_order();
  EXPECT_THAT(Watch(CreateJob(request)).back(), WarnsOnlyOf("mesh_x"));
  // An order that is said is meant.
  request.mutable_mesh_x()->set_vertex_order(v1::VERTEX_ORDER_DECODED);
  EXPECT_THAT(Watch(CreateJob(request)).back().result().warnings(),
              testing::IsEmpty());
  // By digest too, once the mesh is known.
  const std::string bytes = request.mesh_y().draco();
  v1::Mesh& mesh_y = *request.mutable_mesh_y();
  mesh_y.clear_vertex_order();
  mesh_y.mutable_digest()->set_sha256(Sha256Hex(bytes));
  mesh_y.mutable_digest()->set_size_bytes(bytes.size());
  EXPECT_THAT(Watch(CreateJob(request)).back(), WarnsOnlyOf("mesh_y"));
}

TEST_F(ParseCreateJobTest, SequentialWithoutAnOrderIsNoWarning) {
  TriangleMesh mesh = UnitSphere(1);
  mesh.positions.conservativeResize(mesh.num_vertices() + 1, 3);
  mesh.positions.bottomRows(1).setZero();
  v1::CreateJobRequest request = SphereJob();
  *request.mutable_mesh_x() = ToDraco(mesh);
  ASSERT_FALSE(RenumbersVertices(request.mesh_x().draco()));
  request.mutable_mesh_x()->clear_vertex_order();
  EXPECT_THAT(Watch(CreateJob(request)).back().result().warnings(),
              testing::IsEmpty());
}

/// A triangle of edges about 1, as encoders that leave it where it lies do.
std::string TriangleAt(float x, float y) {
  const float values[] = {x, y, 120, x + 1, y, 120, x, y + 1, 120};
  return DracoTriangle(
      std::string("\0\1\2", 3),
      DracoAttribute(/*POSITION*/ 0, /*DT_FLOAT32*/ 9, 3) +
          std::string(reinterpret_cast<const char*>(values), sizeof values));
}

TEST_F(ParseCreateJobTest, AShapeThatSinglePrecisionRoundsIsAWarning) {
  v1::CreateJobRequest request = SphereJob();
  request.mutable_mesh_x()->Clear();
  request.mutable_mesh_x()->set_draco(TriangleAt(500, 4500));
  EXPECT_THAT(Watch(CreateJob(request)).back().result().warnings(),
              testing::IsEmpty());
  request.mutable_mesh_x()->set_draco(TriangleAt(500'000, 4'500'000));
  EXPECT_THAT(Watch(CreateJob(request)).back().result().warnings(),
              testing::ElementsAre(testing::AllOf(
                  testing::StartsWith("mesh_x: coordinates of up to 4.5e+06"),
                  testing::HasSubstr("subtract the mesh's middle"))));
}

TEST_F(ParseCreateJobTest, PriorityAndDisconnectPolicyOutOfRange) {
  v1::CreateJobRequest request = SphereJob();
  for (const int priority : {-101, 101, std::numeric_limits<int>::min()}) {
    request.set_priority(priority);
    ExpectRefused(request, "INVALID_FIELD", "priority");
  }
  for (const int priority : {-100, 100}) {
    request.set_priority(priority);
    EXPECT_NE(CreateJob(request), "");
  }
  request.set_disconnect_policy(static_cast<v1::DisconnectPolicy>(3));
  ExpectRefused(request, "INVALID_FIELD", "disconnect_policy");
}

TEST_F(ParseCreateJobTest, SolvedVerticesOutOfRange) {
  v1::CreateJobRequest request = SphereJob();
  for (const std::uint32_t vertices : {1U, 499U, 1'000'000'001U, 0xFFFFFFFFU}) {
    request.mutable_options()->set_solved_vertices(vertices);
    ExpectRefused(request, "INVALID_FIELD", "options.solved_vertices");
  }
  for (const std::uint32_t vertices : {0U, 500U, 1'000'000'000U}) {
    request.mutable_options()->set_solved_vertices(vertices);
    EXPECT_NE(CreateJob(request), "");
  }
}

TEST_F(ParseCreateJobTest, MemoryLimits) {
  v1::CreateJobRequest request = SphereJob();
  for (const std::uint64_t limit :
       {std::uint64_t{1}, std::uint64_t{5'000'000}, ~std::uint64_t{0}}) {
    request.mutable_options()->set_memory_limit_bytes(limit);
    ExpectRefused(request, "INVALID_FIELD", "options.memory_limit_bytes");
  }
  for (const std::uint64_t limit : {0ULL, 1ULL << 30, ~0ULL >> 1}) {
    request.mutable_options()->set_memory_limit_bytes(limit);
    EXPECT_NE(CreateJob(request), "");
  }
}

TEST_F(ParseCreateJobTest, WhatIsAskedForReachesTheMethod) {
  std::vector<int> solved;
  on_found_ = [&](auto&&, const MatchOptions& options, auto&&) {
    solved.push_back(options.solved_vertices);
  };
  v1::CreateJobRequest request = SphereJob();
  Watch(CreateJob(request));
  request.mutable_options()->set_solved_vertices(0);
  Watch(CreateJob(request));
  request.mutable_options()->set_solved_vertices(777);
  Watch(CreateJob(request));
  EXPECT_THAT(solved,
              testing::ElementsAre(MatchOptions().solved_vertices, 0, 777));
}

TEST_F(ParseCreateJobTest, IdsLabelsAndTimeoutsOutOfRange) {
  v1::CreateJobRequest request = SphereJob();
  request.set_request_id(std::string(129, 'x'));
  ExpectRefused(request, "INVALID_FIELD", "request_id");
  request = SphereJob();
  (*request.mutable_labels())[std::string(64, 'k')] = "v";
  ExpectRefused(request, "INVALID_FIELD", "labels");
  request = SphereJob();
  request.mutable_run_timeout()->set_seconds(-1);
  ExpectRefused(request, "INVALID_FIELD", "run_timeout");
  request = SphereJob();
  request.mutable_queue_timeout();  // 0 s
  ExpectRefused(request, "INVALID_FIELD", "queue_timeout");
  request = SphereJob();
  request.mutable_deadline();
  ExpectRefused(request, "INVALID_FIELD", "deadline");
}

TEST_F(ParseCreateJobTest, ThePapersProfileHasNoDeadline) {
  v1::CreateJobRequest request = SphereJob();
  request.mutable_deadline()->set_seconds(1);
  request.mutable_options()->set_profile(v1::PROFILE_PAPER);
  ExpectRefused(request, "INVALID_FIELD", "deadline");
}

// Where there is no room to read both at the same time.
TEST(ReadingRoomTest, MeshesAreReadOneAfterTheOther) {
  MemoryBlobStore blobs(0);
  PreparedCache no_cache(0, nullptr);
  const JobRunner runner(
      UnpreparedEngine(), [](auto&&...) { return std::string(); }, absl::Now,
      no_cache);
  ParseContext context = {
      .blobs = &blobs, .runner = &runner, .limits = {}, .threads_per_job = 2};
  const auto least_room = [&](const v1::CreateJobRequest& request) {
    std::int64_t below = 0;
    std::int64_t enough = 1 << 24;
    while (enough - below > 1) {
      context.limits.max_reading_bytes = (below + enough) / 2;
      const auto parsed = ParseCreateJob(request, context, "");
      const bool fits = parsed.ok();
      EXPECT_TRUE(fits || IsNeedsMoreMemory(parsed.status()));
      (fits ? enough : below) = context.limits.max_reading_bytes;
    }
    return enough;
  };
  v1::CreateJobRequest request;
  *request.mutable_mesh_x() = ToDraco(UnitSphere(0));
  *request.mutable_mesh_y() = ToDraco(UnitSphere(3));
  const std::int64_t for_one = least_room(request);
  *request.mutable_mesh_x() = request.mesh_y();
  const std::int64_t for_both = least_room(request);
  const MeshSize size = SizeOf(UnitSphere(3));
  EXPECT_EQ(for_both - for_one,
            static_cast<std::int64_t>(MeshBytes(size) -
                                      MeshBytes(SizeOf(UnitSphere(0)))));
}

// A job runs on either, by whether it had to wait.
TEST(StoredRequestTest, WhatIsLoadedIsWhatWasParsed) {
  MemoryBlobStore blobs(std::int64_t{1} << 20);
  PreparedCache no_cache(0, nullptr);
  const JobRunner runner(
      UnpreparedEngine(), [](auto&&...) { return std::string(); }, absl::Now,
      no_cache);
  const ParseContext context = {
      .blobs = &blobs, .runner = &runner, .limits = {}, .threads_per_job = 2};
  v1::CreateJobRequest request;
  *request.mutable_mesh_x() = ToDraco(UnitSphere(1));
  *request.mutable_mesh_y() = ToDraco(UnitSphere(2));
  request.mutable_mesh_x()->clear_vertex_order();  // which is warned of
  request.add_landmarks()->set_y(7);
  request.mutable_options()->set_random_seed(9);
  request.mutable_deadline()->set_seconds(3);
  auto parsed = ParseCreateJob(request, context, "tenant");
  ASSERT_THAT(parsed, IsOk());
  SetInputs("tenant", request, *parsed);
  JobRecord record;
  record.tenant = "tenant";
  record.threads = parsed->options.threads;
  for (const JobInput& input : parsed->inputs) {
    record.inputs.push_back(input.sha256);
    ASSERT_THAT(
        blobs.Put({"tenant", input.sha256}, *input.bytes, Keep::kPinned),
        IsOk());
  }
  const auto loaded = LoadJobSpec(record, context);
  ASSERT_THAT(loaded, IsOk());
  EXPECT_EQ(loaded->mesh_x.positions, parsed->mesh_x.positions);
  EXPECT_EQ(loaded->mesh_x.faces, parsed->mesh_x.faces);
  EXPECT_EQ(loaded->mesh_y.positions, parsed->mesh_y.positions);
  EXPECT_EQ(loaded->landmarks[0].y, 7);
  EXPECT_EQ(loaded->options.random_seed, parsed->options.random_seed);
  EXPECT_EQ(loaded->options.threads, parsed->options.threads);
  EXPECT_EQ(loaded->deadline, parsed->deadline);
  EXPECT_THAT(parsed->warnings, testing::SizeIs(1));
  EXPECT_EQ(loaded->warnings, parsed->warnings);
  ASSERT_TRUE(parsed->prepared_x && parsed->prepared_y);
  EXPECT_EQ(loaded->prepared_x->sha256, parsed->prepared_x->sha256);
  EXPECT_EQ(loaded->prepared_y->sha256, parsed->prepared_y->sha256);
  EXPECT_EQ(loaded->prepared_x->tenant, parsed->prepared_x->tenant);
  EXPECT_NE(loaded->prepared_x->sha256, loaded->prepared_y->sha256);
}

TEST_F(ParseCreateJobTest, AMeshThatWasNotUploaded) {
  v1::CreateJobRequest request = SphereJob();
  v1::Digest& digest = *request.mutable_mesh_x()->mutable_digest();
  digest.set_sha256(std::string(64, 'a'));
  digest.set_size_bytes(1);
  const CallError error = CreateError(request);
  EXPECT_EQ(error.code, grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_EQ(error.reason, "MESH_MISSING");
  EXPECT_EQ(error.field, "mesh_x.digest");
}

}  // namespace
}  // namespace isomatch
