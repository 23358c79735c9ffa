// The client against a real server, over a network that fails.

#include "client/api/isomatch_client.h"

#include <filesystem>
#include <fstream>
#include <future>
#include <memory>
#include <optional>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/time/clock.h"
#include "client/api/connection.h"
#include "core/base/sha256.h"
#include "tests/client/api/tcp_proxy.h"
#include "tests/server/test_server.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::HasSubstr;

class IsomatchClientTest : public TestServer {
 protected:
  IsomatchClientTest() { Connect(TestConfig()); }

  void Connect(ServerConfig config) {
    Restart(config);
    proxy_.emplace(server_->address());
  }

  // Small requests, so that the meshes of LargePair are uploaded.
  void ConnectWithSmallRequests() {
    ServerConfig config = TestConfig();
    config.max_request_bytes = 2 << 20;
    Connect(config);
  }

  static MatchRequest SmallPair() {
    return {UnitSphere(1), Tetrahedron(), {}, v1::PROFILE_DEFAULT, 1, 0};
  }

  // About 2.3 MiB of Draco; the map has 750 KiB.
  static MatchRequest LargePair() {
    MatchRequest request = SmallPair();
    request.mesh_x = WithIsolated(UnitSphere(6), 150'000);
    return request;
  }

  // Vertices on no face make a mesh large without making it slow to build.
  static TriangleMesh WithIsolated(TriangleMesh mesh, VertexIndex count) {
    const VertexIndex before = mesh.num_vertices();
    mesh.positions.conservativeResize(before + count, Eigen::NoChange);
    mesh.positions.bottomRows(count).setRandom();
    return mesh;
  }

  absl::StatusOr<MatchResult> Match(const MatchRequest& request,
                                    const std::stop_token& stop = {}) {
    return IsomatchClient(ConnectTo(proxy_->address()))
        .Match(request, {}, stop);
  }

  auto StartMatch(const MatchRequest& request,
                  const std::stop_token& stop = {}) {
    return std::async(std::launch::async,
                      [=, this] { return Match(request, stop); });
  }

  // The gated engine maps vertex i to i % |Y|.
  static void ExpectMap(const MatchRequest& request,
                        const absl::StatusOr<MatchResult>& result) {
    ASSERT_THAT(result, IsOk());
    ASSERT_EQ(result->y_from_x.size(),
              static_cast<std::size_t>(request.mesh_x.num_vertices()));
    for (std::size_t i = 0; i < result->y_from_x.size(); ++i) {
      ASSERT_EQ(result->y_from_x[i],
                static_cast<VertexIndex>(i) % request.mesh_y.num_vertices());
    }
  }

  v1::Job::State StateOfOnlyJob() {
    grpc::ClientContext context;
    v1::ListJobsResponse response;
    EXPECT_TRUE(stub_->ListJobs(&context, {}, &response).ok());
    EXPECT_EQ(response.jobs_size(), 1);
    return response.jobs(0).state();
  }

  std::optional<TcpProxy> proxy_;
};

TEST_F(IsomatchClientTest, LargeMeshesAreUploadedOnce) {
  ConnectWithSmallRequests();
  const MatchRequest request = LargePair();
  ExpectMap(request, Match(request));
  const std::int64_t sent = proxy_->bytes_passed(TcpProxy::kToServer);
  EXPECT_GT(sent, 2 << 20);
  ExpectMap(request, Match(request));
  EXPECT_LT(proxy_->bytes_passed(TcpProxy::kToServer) - sent, 16 << 10);
}

TEST_F(IsomatchClientTest, AMeshThatIsDamagedThereIsSentAgain) {
  const TemporaryFolder folder;
  ServerConfig config = TestConfig();
  config.max_request_bytes = 2 << 20;
  config.ephemeral = false;
  config.data_dir = folder.Path("data");
  Connect(config);
  const MatchRequest request = LargePair();
  ExpectMap(request, Match(request));
  namespace fs = std::filesystem;
  int damaged = 0;
  for (const auto& file :
       fs::recursive_directory_iterator(folder.Path("data/blobs"))) {
    if (!file.is_regular_file() || file.file_size() < (1 << 20)) continue;
    std::fstream bytes(file.path(), std::ios::in | std::ios::out);
    bytes.seekp(1000);
    bytes << "no longer what it was";
    ++damaged;
  }
  ASSERT_EQ(damaged, 1);  // of X; the map is smaller
  ExpectMap(request, Match(request));
}

TEST_F(IsomatchClientTest, ALostUploadIsSentAgain) {
  ConnectWithSmallRequests();
  const MatchRequest request = LargePair();
  proxy_->CutAfter(TcpProxy::kToServer, 600'000);
  ExpectMap(request, Match(request));
  EXPECT_EQ(proxy_->cuts(), 1);
}

TEST_F(IsomatchClientTest, AnUploadGoesOnAtItsOffsetAndDoesNotBeginAnew) {
  ConnectWithSmallRequests();
  // The connection is cut within the third chunk. What is in flight then is
  // sent twice; on a busy machine that can be nearly all of it. Beginning anew
  // always sends the two chunks again.
  constexpr std::int64_t kChunk = 1 << 20;
  constexpr std::int64_t kCut = kChunk * 9 / 4;
  bool went_on = false;
  for (int attempt = 1; attempt <= 10 && !went_on; ++attempt) {
    MatchRequest request = SmallPair();
    request.mesh_x = WithIsolated(UnitSphere(6), 200'000);  // 2.7 MiB
    const std::int64_t before = proxy_->bytes_passed(TcpProxy::kToServer);
    proxy_->CutAfter(TcpProxy::kToServer, kCut);
    ExpectMap(request, Match(request));
    EXPECT_EQ(proxy_->cuts(), attempt);
    const std::int64_t sent =
        proxy_->bytes_passed(TcpProxy::kToServer) - before;
    const std::int64_t bytes = 12 * request.mesh_x.num_vertices();
    went_on = sent < kCut + bytes - kChunk / 2;
  }
  EXPECT_TRUE(went_on);
}

TEST_F(IsomatchClientTest, WhatTheServerHasOfAnotherContentDoesNotStopIt) {
  ConnectWithSmallRequests();
  const MatchRequest request = LargePair();
  v1::UploadMeshRequest part;
  const std::string bytes = EncodeDraco(request.mesh_x)->bytes;
  part.mutable_header()->set_sha256(Sha256Hex(bytes));
  part.mutable_header()->set_size_bytes(bytes.size());
  grpc::ClientContext context;
  v1::UploadMeshResponse response;
  const auto writer = stub_->UploadMesh(&context, &response);
  writer->Write(part);
  part.set_chunk("not the mesh");
  writer->Write(part);
  writer->WritesDone();
  EXPECT_FALSE(writer->Finish().ok());
  ExpectMap(request, Match(request));
}

TEST_F(IsomatchClientTest, OptionsAndPriorityReachTheServer) {
  int solved = -1;
  on_found_ = [&](auto&&, const MatchOptions& options, auto&&) {
    solved = options.solved_vertices;
  };
  MatchRequest request = SmallPair();
  request.solved_vertices = 777;
  ExpectMap(request, Match(request));
  EXPECT_EQ(solved, 777);
  request.priority = 101;
  EXPECT_THAT(Match(request), StatusIs(absl::StatusCode::kInvalidArgument,
                                       HasSubstr("priority: 101")));
}

TEST_F(IsomatchClientTest, ALostRequestIsSentAgainButMakesOneJob) {
  MatchRequest request = SmallPair();
  request.mesh_x = UnitSphere(5);
  proxy_->CutAfter(TcpProxy::kToServer, 60'000);
  ExpectMap(request, Match(request));
  EXPECT_EQ(proxy_->cuts(), 1);
  EXPECT_EQ(matches_, 1);
}

TEST_F(IsomatchClientTest, ALostAnswerMakesNoSecondJob) {
  const MatchRequest request = SmallPair();
  // After GetServerInfo's answer, within CreateJob's or at WatchJob's begin.
  for (const std::int64_t bytes : {250, 350, 450, 600}) {
    const int before = matches_;
    proxy_.emplace(server_->address());
    proxy_->CutAfter(TcpProxy::kToClient, bytes);
    ExpectMap(request, Match(request));
    EXPECT_EQ(proxy_->cuts(), 1) << bytes;
    EXPECT_EQ(matches_, before + 1) << bytes;
  }
}

TEST_F(IsomatchClientTest, ALostWatchGoesOn) {
  gate_open_ = false;
  const MatchRequest request = SmallPair();
  auto result = StartMatch(request);
  WaitForMatches(1);
  for (int i = 0; i < 3; ++i) {
    absl::SleepFor(absl::Milliseconds(100));
    proxy_->Cut();
  }
  gate_open_ = true;
  ExpectMap(request, result.get());
  EXPECT_EQ(matches_, 1);
}

TEST_F(IsomatchClientTest, ALostDownloadGoesOnWhereItWas) {
  ConnectWithSmallRequests();
  gate_open_ = false;
  const MatchRequest request = LargePair();
  auto result = StartMatch(request);
  WaitForMatches(1);
  // Within the second chunk of 256 KiB.
  proxy_->CutAfter(TcpProxy::kToClient, 350 << 10);
  gate_open_ = true;
  ExpectMap(request, result.get());
  EXPECT_EQ(proxy_->cuts(), 1);
}

TEST_F(IsomatchClientTest, ADownloadGoesOnAtItsOffsetAndDoesNotBeginAnew) {
  ConnectWithSmallRequests();
  on_found_ = FindEverything;
  MatchRequest request = LargePair();
  request.parts = {v1::RESULT_PART_PRECISE_MAP};
  // 4 bytes a vertex for the map, then 24 for the precise map.
  const std::int64_t map_bytes = 4 * request.mesh_x.num_vertices();
  // What is in flight when the connection is cut is sent twice; on a busy
  // machine that can be nearly all of it. Beginning anew always sends 12 maps.
  bool went_on = false;
  for (int attempt = 1; attempt <= 10 && !went_on; ++attempt) {
    gate_open_ = false;
    auto result = StartMatch(request);
    WaitForMatches(attempt);
    const std::int64_t before = proxy_->bytes_passed(TcpProxy::kToClient);
    proxy_->CutAfter(TcpProxy::kToClient, 6 * map_bytes);
    gate_open_ = true;
    const absl::StatusOr<MatchResult> found = result.get();
    ExpectMap(request, found);
    EXPECT_EQ(proxy_->cuts(), attempt);
    ASSERT_TRUE(found->precise);
    EXPECT_THAT(found->precise->back().weights,
                testing::ElementsAre(0.5, 0.375, 0.125));
    went_on =
        proxy_->bytes_passed(TcpProxy::kToClient) - before < 10 * map_bytes;
  }
  EXPECT_TRUE(went_on);
}

TEST_F(IsomatchClientTest, OnlyThePartsAskedForAreDownloaded) {
  on_found_ = FindEverything;
  MatchRequest request = SmallPair();
  const auto plain = Match(request);
  ExpectMap(request, plain);
  EXPECT_FALSE(plain->precise || plain->confidence || plain->alternative ||
               plain->functional_map || plain->matched_y);
  request.parts = {v1::RESULT_PART_CONFIDENCE, v1::RESULT_PART_ALTERNATIVE_MAP,
                   v1::RESULT_PART_FUNCTIONAL_MAP, v1::RESULT_PART_MASK_Y};
  const auto more = Match(request);
  ExpectMap(request, more);
  EXPECT_FALSE(more->precise);
  ASSERT_TRUE(more->confidence && more->alternative && more->functional_map);
  EXPECT_EQ((*more->confidence)[8], 0.1f);
  EXPECT_EQ((*more->alternative)[7], 0);
  EXPECT_EQ(more->functional_map->fmap_x_from_y(0, 1), 2);
  EXPECT_THAT(more->matched_y,
              testing::Optional(testing::ElementsAre(1, 0, 1, 1)));
}

TEST_F(IsomatchClientTest, APartThatTheResultLacksIsLeftOut) {
  MatchRequest request = SmallPair();
  request.parts = {v1::RESULT_PART_ALTERNATIVE_MAP};
  const auto result = Match(request);
  ExpectMap(request, result);
  EXPECT_FALSE(result->alternative);
}

TEST_F(IsomatchClientTest, ALostServerIsGivenUp) {
  gate_open_ = false;
  auto result = StartMatch(SmallPair());
  WaitForMatches(1);
  const absl::Time begin = absl::Now();
  proxy_->RefuseAll();
  EXPECT_THAT(result.get(),
              StatusIs(absl::StatusCode::kUnavailable, testing::_));
  EXPECT_GT(absl::Now() - begin, absl::Seconds(5));
  EXPECT_LT(absl::Now() - begin, absl::Seconds(15));
}

TEST_F(IsomatchClientTest, AServerThatNeverAnswersIsGivenUpSoon) {
  const absl::Time begin = absl::Now();
  proxy_->RefuseAll();
  EXPECT_THAT(Match(SmallPair()),
              StatusIs(absl::StatusCode::kUnavailable,
                       HasSubstr("no answer within 3s, expected a running")));
  EXPECT_LT(absl::Now() - begin, absl::Seconds(5));
}

TEST_F(IsomatchClientTest, AServerThatStartsInAMomentIsWaitedFor) {
  ServerConfig config = TestConfig();
  config.listen = server_->address();
  server_.reset();
  const std::jthread starter([&] {
    absl::SleepFor(absl::Milliseconds(600));
    Restart(config);
  });
  EXPECT_THAT(IsomatchClient(ConnectTo(config.listen)).GetServerInfo(), IsOk());
}

TEST_F(IsomatchClientTest, PatienceIsWhatTheCallerHas) {
  ServerConfig config = TestConfig();
  config.listen = server_->address();
  server_.reset();
  const absl::Time begin = absl::Now();
  EXPECT_THAT(IsomatchClient(ConnectTo(config.listen), absl::ZeroDuration())
                  .GetServerInfo(),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("within 0")));
  EXPECT_LT(absl::Now() - begin, absl::Seconds(2));
  // Longer than a server that never answered has by default.
  const std::jthread starter([&] {
    absl::SleepFor(absl::Seconds(4));
    Restart(config);
  });
  EXPECT_THAT(IsomatchClient(ConnectTo(config.listen), absl::Seconds(30))
                  .GetServerInfo(),
              IsOk());
}

TEST_F(IsomatchClientTest, ALatecomerIsWaitedFor) {
  proxy_->CutAfter(TcpProxy::kToServer, 1);
  const MatchRequest request = SmallPair();
  ExpectMap(request, Match(request));
}

TEST_F(IsomatchClientTest, StoppingCancelsTheJobOnTheServer) {
  gate_open_ = false;
  std::stop_source stop;
  auto result = StartMatch(SmallPair(), stop.get_token());
  WaitForMatches(1);
  stop.request_stop();
  EXPECT_THAT(result.get(),
              StatusIs(absl::StatusCode::kCancelled, HasSubstr("by the user")));
  EXPECT_EQ(StateOfOnlyJob(), v1::Job::STATE_CANCELLED);
}

TEST_F(IsomatchClientTest, ARefusalNamesTheField) {
  MatchRequest request = SmallPair();
  request.landmarks = {{0, 0}, {0, 1}};
  EXPECT_THAT(Match(request), StatusIs(absl::StatusCode::kInvalidArgument,
                                       HasSubstr("LANDMARKS_CONTRADICT")));
}

}  // namespace
}  // namespace isomatch
