// X is a part of Y.

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/evaluation/geodesic_error.h"
#include "core/mesh/mesh_geometry.h"
#include "core/mesh/mesh_size.h"
#include "core/mesh/topology.h"
#include "core/pipeline/matcher.h"
#include "core/pipeline/memory_estimate.h"
#include "tests/support/dirty_meshes.h"
#include "tests/support/matchers.h"
#include "tests/support/memory_growth.h"
#include "tests/support/quick_options.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::HasSubstr;

/// Less than half of FiveArms, relabeled and moved; and all of it.
class PartOfYTest : public testing::Test {
 protected:
  static constexpr double kPartScale = 3;

  PartOfYTest() {
    part_ = MovedPart(whole_, Beyond({-0.5, -0.6, 0.3}, 0.1), /*seed=*/6,
                      kPartScale);
    options_ = QuickOptions();
    options_.relation = Relation::kPartOfY;
  }

  void SetUp() override {
    ASSERT_EQ(ConnectedComponents(part_.mesh).count, 1);
    const double left = SurfaceArea(part_.mesh) /
                        (kPartScale * kPartScale * SurfaceArea(whole_));
    ASSERT_LT(left, 0.7);
    ASSERT_GT(left, 0.3);
  }

  double ErrorOf(const VertexMap& map) const {
    return GeodesicErrorMeter(whole_)
        .Measure(map, part_.origin)
        ->mean_over_diameter;
  }

  /// The part in the whole's unit.
  TriangleMesh PartInOneUnit() const {
    return {part_.mesh.positions / kPartScale, part_.mesh.faces};
  }

  TriangleMesh whole_ = FiveArms(4);
  DirtyMesh part_;
  MatchOptions options_;
};

TEST_F(PartOfYTest, IsFoundInOneUnit) {
  options_.scale = LengthScale::kSame;
  const auto found = Match(PartInOneUnit(), whole_, {}, options_);
  ASSERT_THAT(found, IsOk());
  EXPECT_LT(ErrorOf(found->y_from_x), 0.01);
  EXPECT_EQ(found->scale, 1);
  EXPECT_EQ(found->relation, Relation::kPartOfY);
  EXPECT_EQ(found->matched_y.size(), std::size_t(whole_.num_vertices()));
  // As wholes they are not.
  const auto as_wholes = Match(PartInOneUnit(), whole_, {}, QuickOptions());
  ASSERT_THAT(as_wholes, IsOk());
  EXPECT_GT(ErrorOf(as_wholes->y_from_x), 0.05);
}

TEST_F(PartOfYTest, TheScaleIsFoundToo) {
  const auto found = Match(part_.mesh, whole_, {}, options_);
  ASSERT_THAT(found, IsOk());
  EXPECT_LT(ErrorOf(found->y_from_x), 0.015);
  EXPECT_NEAR(found->scale * kPartScale, 1, 0.04);
}

TEST_F(PartOfYTest, TheNextScaleIsAnother) {
  // Where it is large and where it is small.
  const TriangleMesh both =
      Joined(Untouched(whole_), Untouched(Moved(whole_, 0.5)),
             whole_.num_vertices())
          .mesh;
  const auto likeliest = Match(part_.mesh, both, {}, options_);
  ASSERT_THAT(likeliest, IsOk());
  options_.next_scale = true;
  const auto next = Match(part_.mesh, both, {}, options_);
  ASSERT_THAT(next, IsOk());
  const double smaller = std::min(likeliest->scale, next->scale);
  const double larger = std::max(likeliest->scale, next->scale);
  EXPECT_NEAR(larger * kPartScale, 1, 0.05);
  EXPECT_NEAR(smaller * kPartScale, 0.5, 0.03);
}

TEST_F(PartOfYTest, ThereMayBeNoOtherScale) {
  options_.next_scale = true;
  const auto found = Match(part_.mesh, whole_, {}, options_);
  EXPECT_EQ(found.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(found.status().message(), HasSubstr("no other scale"));
}

TEST_F(PartOfYTest, InTheWrongUnitItIsNotFound) {
  options_.scale = LengthScale::kSame;
  const auto found = Match(part_.mesh, whole_, {}, options_);
  ASSERT_THAT(found, IsOk());
  EXPECT_GT(ErrorOf(found->y_from_x), 0.05);
  EXPECT_EQ(found->verdict.level, VerdictLevel::kBad);
  EXPECT_THAT(found->verdict.advice, HasSubstr("whether both have one unit"));
}

TEST_F(PartOfYTest, AGoodMapIsCalledGoodWhateverIsLeftOfY) {
  options_.scale = LengthScale::kSame;
  const auto found = Match(PartInOneUnit(), whole_, {}, options_);
  ASSERT_THAT(found, IsOk());
  EXPECT_LT(found->quality.coverage, 0.8);
  EXPECT_EQ(found->verdict.level, VerdictLevel::kGood) << found->verdict.reason;
}

TEST_F(PartOfYTest, AWholeIsAPartOfItself) {
  const auto found = Match(Moved(whole_, 2), whole_, {}, options_);
  ASSERT_THAT(found, IsOk());
  EXPECT_LT(GeodesicErrorMeter(whole_)
                .Measure(found->y_from_x, IdentityMap(whole_.num_vertices()))
                ->mean_over_diameter,
            0.01);
  EXPECT_NEAR(found->scale, 0.5, 0.02);
}

TEST_F(PartOfYTest, TheSameBytesAtAnyThreadCountAndOfPreparedShapes) {
  options_.threads = 1;
  const auto alone = Match(part_.mesh, whole_, {}, options_);
  ASSERT_THAT(alone, IsOk());
  options_.threads = 4;
  const auto together = Match(part_.mesh, whole_, {}, options_);
  ASSERT_THAT(together, IsOk());
  EXPECT_EQ(alone->y_from_x, together->y_from_x);
  EXPECT_EQ(alone->confidence, together->confidence);
  EXPECT_EQ(alone->scale, together->scale);
  // Prepared for wholes, and used again.
  const auto x = Prepare(part_.mesh, QuickOptions());
  const auto y = Prepare(whole_, QuickOptions());
  ASSERT_THAT(x, IsOk());
  ASSERT_THAT(y, IsOk());
  for (int again = 0; again < 2; ++again) {
    const auto prepared = MatchPrepared(*x, *y, {}, options_);
    ASSERT_THAT(prepared, IsOk());
    EXPECT_EQ(prepared->y_from_x, alone->y_from_x);
    EXPECT_EQ(prepared->confidence, alone->confidence);
  }
}

TEST_F(PartOfYTest, LandmarksAreKept) {
  options_.scale = LengthScale::kSame;
  const std::vector<Landmark> landmarks = {{5, part_.origin[5]},
                                           {200, part_.origin[200]}};
  const auto found = Match(PartInOneUnit(), whole_, landmarks, options_);
  ASSERT_THAT(found, IsOk());
  EXPECT_LT(ErrorOf(found->y_from_x), 0.01);
  for (const Landmark& landmark : landmarks) {
    EXPECT_EQ(found->y_from_x[landmark.x], landmark.y);
  }
}

TEST_F(PartOfYTest, DecimatedShapesAreLifted) {
  options_.solved_vertices = 1200;
  const auto found = Match(part_.mesh, whole_, {}, options_);
  ASSERT_THAT(found, IsOk());
  EXPECT_LT(ErrorOf(found->y_from_x), 0.02);
}

TEST_F(PartOfYTest, TheMemoryEstimateIsAnUpperBound) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers change what a process allocates";
#endif
  MatchOptions options;
  options.relation = Relation::kPartOfY;
  const MemoryGrowth growth;
  ASSERT_THAT(Match(part_.mesh, whole_, {}, options), IsOk());
  const std::int64_t measured = growth.Bytes();
  const std::int64_t estimate =
      EstimateMemoryBytes(SizeOf(part_.mesh), SizeOf(whole_), 0, options);
  RecordProperty("measured_bytes", std::to_string(measured));
  RecordProperty("estimate_bytes", std::to_string(estimate));
  EXPECT_GE(estimate, measured);
  EXPECT_LE(estimate, 2 * measured + (std::int64_t{16} << 20));
}

// Most of the time goes into the scale, and what is grown for it is told of.
TEST_F(PartOfYTest, ProgressNeverFallsOrHaltsAndEnds) {
  std::vector<double> totals;
  std::vector<double> seeds;
  const auto found =
      Match(part_.mesh, whole_, {}, options_, {[&](const Progress& progress) {
              totals.push_back(progress.total_fraction);
              if (progress.stage == Stage::kSeeds) {
                seeds.push_back(progress.total_fraction);
              }
            }});
  ASSERT_THAT(found, IsOk());
  EXPECT_TRUE(std::is_sorted(totals.begin(), totals.end()));
  EXPECT_EQ(totals.back(), 1);
  ASSERT_GT(seeds.size(), 15u);
  const double share = seeds.back() - seeds.front();
  EXPECT_GT(share, 0.2);
  for (std::size_t i = 1; i < seeds.size(); ++i) {
    EXPECT_LT(seeds[i] - seeds[i - 1], 0.3 * share);
  }
}

TEST(PartOptionsTest, WhatDoesNotGoTogetherIsNamed) {
  MatchOptions options;
  options.scale = LengthScale::kSame;
  EXPECT_THAT(options.Validate(),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("options.scale: same, expected auto")));
  options = MatchOptions::ForProfile(Profile::kPaper);
  options.relation = Relation::kPartOfY;
  EXPECT_THAT(options.Validate(),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("options.relation: part-of-y, expected")));
}

}  // namespace
}  // namespace isomatch
