// The parts of a result on their way from the method to a client.

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/sha256.h"
#include "core/pipeline/match_engine.h"
#include "tests/server/test_server.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::ElementsAre;

class ResultPartsTest : public TestServer {
 protected:
  struct Download {
    v1::DownloadResultResponse::Header header;
    std::string bytes;
    grpc::Status status;
  };

  Download Get(const std::string& name, int part, std::uint64_t offset = 0) {
    grpc::ClientContext context;
    v1::DownloadResultRequest request;
    request.set_name(name);
    request.set_offset(offset);
    request.set_part(static_cast<v1::ResultPart>(part));
    const auto reader = stub_->DownloadResult(&context, request);
    Download download;
    for (v1::DownloadResultResponse response; reader->Read(&response);) {
      if (response.has_header()) download.header = response.header();
      download.bytes += response.chunk();
    }
    download.status = reader->Finish();
    return download;
  }

  /// A job that has run, with all parts and two landmarks.
  std::string RunJobWithEverything() {
    on_found_ = FindEverything;
    v1::CreateJobRequest request = SphereJob();
    request.mutable_options()->set_functional_map(true);
    for (const std::uint32_t vertex : {2U, 3U}) {
      v1::Landmark& landmark = *request.add_landmarks();
      landmark.set_x(vertex + 10);
      landmark.set_y(vertex);
    }
    std::string name = CreateJob(request);
    Watch(name);
    return name;
  }

  grpc::Status Delete(const std::string& name) {
    grpc::ClientContext context;
    v1::DeleteJobRequest request;
    request.set_name(name);
    v1::DeleteJobResponse response;
    return stub_->DeleteJob(&context, request, &response);
  }

  /// The numbers that `bytes` hold; this machine is little-endian.
  template <typename Number>
  static std::vector<Number> Numbers(const std::string& bytes) {
    std::vector<Number> numbers(bytes.size() / sizeof(Number));
    std::memcpy(numbers.data(), bytes.data(), numbers.size() * sizeof(Number));
    return numbers;
  }
};

TEST_F(ResultPartsTest, EachPartComesAsTheMethodFoundIt) {
  const std::string name = RunJobWithEverything();
  const v1::ResultInfo info = GetJob(name).result();
  ASSERT_EQ(info.parts_size(), 6);
  for (const v1::ResultPartInfo& part : info.parts()) {
    const Download download = Get(name, part.part());
    ASSERT_TRUE(download.status.ok()) << part.DebugString();
    EXPECT_EQ(download.header.digest().sha256(), part.digest().sha256());
    EXPECT_EQ(download.bytes.size(), part.digest().size_bytes());
    EXPECT_EQ(Sha256Hex(download.bytes), part.digest().sha256());
    EXPECT_EQ(download.header.vertices_x(), 42);
    EXPECT_EQ(download.header.vertices_y(), 4);
  }
  EXPECT_EQ(info.digest().sha256(), info.parts(0).digest().sha256());
  EXPECT_EQ(Get(name, v1::RESULT_PART_UNSPECIFIED).bytes,
            Get(name, v1::RESULT_PART_MAP).bytes);
  const std::string points = Get(name, v1::RESULT_PART_PRECISE_MAP).bytes;
  ASSERT_EQ(points.size(), 42 * 24);
  EXPECT_THAT(Numbers<std::uint32_t>(points.substr(24 * 6, 12)),
              ElementsAre(2, 3, 0));
  EXPECT_THAT(Numbers<float>(points.substr(24 * 6 + 12, 12)),
              ElementsAre(0.5f, 0.375f, 0.125f));
  EXPECT_EQ(Numbers<float>(Get(name, v1::RESULT_PART_CONFIDENCE).bytes)[8],
            0.1f);
  EXPECT_EQ(Numbers<std::uint32_t>(
                Get(name, v1::RESULT_PART_ALTERNATIVE_MAP).bytes)[7],
            0);
  EXPECT_THAT(
      Numbers<double>(
          Get(name, v1::RESULT_PART_FUNCTIONAL_MAP, /*offset=*/4).bytes),
      ElementsAre(0, 5, 0, 6, 1, 2, 3, 4));
  EXPECT_THAT(Get(name, v1::RESULT_PART_MASK_Y).bytes, ElementsAre(1, 0, 1, 1));
}

TEST_F(ResultPartsTest, EachPartResumesAtItsOwnOffset) {
  const std::string name = RunJobWithEverything();
  for (int part = v1::ResultPart_MIN + 1; part <= v1::ResultPart_MAX; ++part) {
    const std::string whole = Get(name, part).bytes;
    EXPECT_EQ(Get(name, part, 3).bytes, whole.substr(3)) << part;
    EXPECT_EQ(ErrorOf(Get(name, part, whole.size() + 1).status).reason,
              "OFFSET_OUT_OF_RANGE");
  }
}

TEST_F(ResultPartsTest, APartThatTheResultLacksIsNotFound) {
  const std::string name = CreateJob();
  Watch(name);
  EXPECT_EQ(GetJob(name).result().parts_size(), 1);
  const CallError error =
      ErrorOf(Get(name, v1::RESULT_PART_FUNCTIONAL_MAP).status);
  EXPECT_EQ(error.code, grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(error.reason, "RESULT_PART_MISSING");
  EXPECT_EQ(error.field, "part");
}

TEST_F(ResultPartsTest, AnUnknownPartIsRefused) {
  const std::string name = CreateJob();
  Watch(name);
  const CallError error = ErrorOf(Get(name, 99).status);
  EXPECT_EQ(error.code, grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(error.reason, "INVALID_FIELD");
  EXPECT_EQ(error.field, "part");
}

TEST_F(ResultPartsTest, ADeletedJobHasNoParts) {
  const std::string name = RunJobWithEverything();
  ASSERT_TRUE(Delete(name).ok());
  EXPECT_EQ(ErrorOf(Get(name, v1::RESULT_PART_CONFIDENCE).status).reason,
            "JOB_NOT_FOUND");
}

TEST_F(ResultPartsTest, TheFiguresOfTheMapAreTold) {
  const v1::ResultInfo info = GetJob(RunJobWithEverything()).result();
  EXPECT_EQ(info.scores().embedding_error(), 1);
  EXPECT_EQ(info.embedding_error(), 1);
  EXPECT_EQ(info.scores().orientation_score(), -0.5);
  EXPECT_EQ(info.orientation_score(), -0.5);
  EXPECT_EQ(info.scores().curvature_mismatch(), 3);
  EXPECT_EQ(info.scores().normal_mismatch(), 4);
  EXPECT_EQ(info.scores().descriptor_mismatch(), 1.5);
  EXPECT_EQ(info.scores().stretch(), 5);
  EXPECT_EQ(info.scores().landmark_contradiction(), 0.25);
  EXPECT_EQ(info.scores().rank_value(), 7);
  EXPECT_EQ(info.quality().geodesic_distortion(), 0.125);
  EXPECT_EQ(info.quality().coverage(), 0.875);
  EXPECT_EQ(info.quality().area_distortion(), 0.0625);
  EXPECT_EQ(info.quality().mean_confidence(), 0.375);
  EXPECT_EQ(info.verdict().level(), v1::Verdict::LEVEL_DOUBTFUL);
  EXPECT_EQ(info.verdict().reason(), "the reason");
  EXPECT_EQ(info.verdict().advice(), "the advice");
  EXPECT_EQ(info.symmetry_confidence(), 0.125);
  ASSERT_EQ(info.alternatives_size(), 2);
  EXPECT_EQ(info.alternatives(0).scores().rank_value(), 14);
  EXPECT_EQ(info.alternatives(1).scores().rank_value(), 15);
}

TEST_F(ResultPartsTest, WhatBecameOfEachLandmarkIsTold) {
  const std::string name = RunJobWithEverything();
  const v1::ResultInfo info = GetJob(name).result();
  ASSERT_EQ(info.landmarks_size(), 2);
  EXPECT_EQ(info.landmarks(0).landmark().x(), 12);
  EXPECT_EQ(info.landmarks(0).landmark().y(), 2);
  EXPECT_TRUE(info.landmarks(0).kept());
  EXPECT_FALSE(info.landmarks(1).kept());
  EXPECT_EQ(info.landmarks(1).landmark().x(), 13);
  EXPECT_EQ(info.landmarks(1).y_found(), 3);
  EXPECT_EQ(info.landmarks(1).distance(), 0.5);
}

TEST_F(ResultPartsTest, AListLeavesTheLandmarksOut) {
  RunJobWithEverything();
  grpc::ClientContext context;
  v1::ListJobsResponse response;
  ASSERT_TRUE(stub_->ListJobs(&context, {}, &response).ok());
  ASSERT_EQ(response.jobs_size(), 1);
  EXPECT_EQ(response.jobs(0).result().parts_size(), 6);
  EXPECT_EQ(response.jobs(0).result().landmarks_size(), 0);
}

TEST_F(ResultPartsTest, OptionsReachTheMethod) {
  MatchOptions seen;
  on_found_ = [&](auto, const MatchOptions& options, Correspondence&) {
    seen = options;
  };
  for (const bool on : {true, false}) {
    v1::CreateJobRequest request = SphereJob();
    request.mutable_options()->set_landmarks_exact(on);
    request.mutable_options()->set_functional_map(!on);
    Watch(CreateJob(request));
    EXPECT_EQ(seen.landmarks_exact, on);
    EXPECT_EQ(seen.keep_functional_map, !on);
    EXPECT_EQ(seen.relation, Relation::kWhole);
  }
}

TEST_F(ResultPartsTest, RelationAndScaleReachTheMethodAndComeBack) {
  on_found_ = [&](auto, const MatchOptions& options, Correspondence& found) {
    found.relation = options.relation;
    found.scale = options.scale == LengthScale::kSame ? 1 : 0.25;
  };
  v1::CreateJobRequest request = SphereJob();
  v1::Job job;
  for (int relation = 1; relation <= v1::Relation_MAX; ++relation) {
    const auto asked = static_cast<v1::Relation>(relation);
    const bool same = asked == v1::RELATION_OVERLAP;
    request.mutable_options()->set_relation(asked);
    request.mutable_options()->set_scale(same ? v1::LENGTH_SCALE_SAME
                                              : v1::LENGTH_SCALE_AUTO);
    job = Watch(CreateJob(request)).back();
    EXPECT_EQ(job.result().relation(), asked);
    EXPECT_EQ(job.result().scale(), same ? 1 : 0.25);
  }
}

TEST_F(ResultPartsTest, TheRealMethodMakesConsistentParts) {
  Restart(TestConfig(), CoreMatchEngine());
  v1::CreateJobRequest request;
  *request.mutable_mesh_x() = ToDraco(BumpySphere(2));
  *request.mutable_mesh_y() = ToDraco(Moved(BumpySphere(2), 3));
  request.mutable_options()->set_functional_map(true);
  const std::string name = CreateJob(request);
  const v1::Job job = Watch(name).back();
  ASSERT_EQ(job.state(), v1::Job::STATE_SUCCEEDED) << job.DebugString();
  const std::uint32_t n = job.result().mesh_x().vertices();
  const auto points =
      Numbers<std::uint32_t>(Get(name, v1::RESULT_PART_PRECISE_MAP).bytes);
  const auto weights =
      Numbers<float>(Get(name, v1::RESULT_PART_PRECISE_MAP).bytes);
  ASSERT_EQ(points.size(), 6 * n);
  for (size_t i = 0; i < n; ++i) {
    float sum = 0;
    for (size_t corner = 0; corner < 3; ++corner) {
      EXPECT_LT(points[6 * i + corner], n);
      sum += weights[6 * i + 3 + corner];
    }
    ASSERT_NEAR(sum, 1, 1e-6) << i;
  }
  EXPECT_EQ(Get(name, v1::RESULT_PART_CONFIDENCE).bytes.size(), 4 * n);
  EXPECT_EQ(Get(name, v1::RESULT_PART_MASK_Y).bytes, std::string(n, '\1'));
  EXPECT_GT(job.result().quality().mean_confidence(), 0);
  EXPECT_NE(job.result().verdict().level(), v1::Verdict::LEVEL_UNSPECIFIED);
  const std::string functional_map =
      Get(name, v1::RESULT_PART_FUNCTIONAL_MAP).bytes;
  const std::uint32_t k = Numbers<std::uint32_t>(functional_map).at(0);
  EXPECT_GT(k, 1);
  EXPECT_EQ(functional_map.size(), 4 + 8 * (2 * k + k * k));
}

}  // namespace
}  // namespace isomatch
