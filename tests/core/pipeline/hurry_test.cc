// MatchControl::hurry: the best map that there is then.

#include <stop_token>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/pipeline/matcher.h"
#include "tests/core/pipeline/two_poses.h"
#include "tests/support/dirty_meshes.h"
#include "tests/support/matchers.h"
#include "tests/support/quick_options.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::Contains;
using testing::Each;
using testing::Ge;
using testing::HasSubstr;

/// Matches, in a hurry from the first report on that `is_time` holds for.
template <typename Condition>
absl::StatusOr<Correspondence> MatchUntil(const TriangleMesh& x,
                                          const TriangleMesh& y,
                                          const MatchOptions& options,
                                          const Condition& is_time,
                                          std::vector<Progress>* seen) {
  std::stop_source hurry;
  return Match(x, y, {}, options,
               {[&](const Progress& report) {
                  seen->push_back(report);
                  if (is_time(report)) hurry.request_stop();
                },
                {},
                hurry.get_token()});
}

constexpr auto kAtOnce = [](const Progress&) { return true; };
constexpr auto kNever = [](const Progress&) { return false; };

/// Two poses of a body of 1,000 vertices.
class HurryTest : public testing::Test {
 protected:
  void SetUp() override { ASSERT_FALSE(poses_.truth.empty()); }

  template <typename Condition>
  Correspondence Until(const Condition& is_time, int threads = 0) {
    seen_.clear();
    MatchOptions options;
    options.threads = threads;
    auto found = MatchUntil(poses_.x, poses_.y, options, is_time, &seen_);
    EXPECT_THAT(found, IsOk());
    return *std::move(found);
  }

  double ErrorOf(const Correspondence& found) const {
    return poses_.ErrorOf(found.y_from_x);
  }

  const TwoPoses poses_ = ReadTwoPoses(ISOMATCH_TEST_DATA);
  std::vector<Progress> seen_;
};

TEST_F(HurryTest, MoreTimeGivesNoWorseMap) {
  const Correspondence at_once = Until(kAtOnce);
  const Correspondence laid_out = Until([](const Progress& report) {
    return report.stage == Stage::kChoice && report.stage_fraction > 0;
  });
  const Correspondence chosen = Until(
      [](const Progress& report) { return report.stage == Stage::kAlignment; });
  const Correspondence finished = Until(kNever);
  EXPECT_LT(ErrorOf(at_once), 0.05);
  EXPECT_LT(ErrorOf(laid_out), ErrorOf(at_once));
  EXPECT_LE(ErrorOf(chosen), ErrorOf(laid_out));
  // The last rounds hardly move it.
  EXPECT_LE(ErrorOf(finished), 1.05 * ErrorOf(chosen));
  for (const Correspondence* early : {&at_once, &laid_out, &chosen}) {
    EXPECT_TRUE(early->ended_early);
    EXPECT_THAT(early->warnings, Contains(HasSubstr("time was up")));
    EXPECT_THAT(early->y_from_x, Each(Ge(0)));
  }
  EXPECT_FALSE(finished.ended_early);
  EXPECT_THAT(finished.warnings, testing::IsEmpty());
}

TEST_F(HurryTest, RivalsThatWereNotComparedLeaveNoSymmetryConfidence) {
  const Correspondence finished = Until(kNever);
  ASSERT_FALSE(finished.alternatives.empty());
  ASSERT_GT(finished.symmetry_confidence, 0.3);
  const Correspondence early = Until([](const Progress& report) {
    return report.stage == Stage::kChoice && report.stage_fraction > 0;
  });
  EXPECT_TRUE(early.alternatives.empty());
  EXPECT_EQ(early.symmetry_confidence, 0);
  EXPECT_EQ(early.verdict.level, VerdictLevel::kDoubtful);
  EXPECT_THAT(early.verdict.reason, HasSubstr("no time to compare"));
  // Nothing is left out that was compared.
  const Correspondence chosen = Until(
      [](const Progress& report) { return report.stage == Stage::kAlignment; });
  EXPECT_EQ(chosen.symmetry_confidence, finished.symmetry_confidence);
}

TEST_F(HurryTest, TheFirstMapIsTheSameAtAnyThreadCount) {
  const Correspondence one = Until(kAtOnce, 1);
  const Correspondence four = Until(kAtOnce, 4);
  EXPECT_EQ(one.y_from_x, four.y_from_x);
  EXPECT_EQ(one.confidence, four.confidence);
}

TEST_F(HurryTest, ProgressTellsOfTheFirstMapOnceAndForAll) {
  (void)Until(kNever);
  for (const Progress& report : seen_) {
    EXPECT_EQ(report.has_map,
              report.stage >= Stage::kChoice ||
                  report.stage == Stage::kQuality ||
                  (report.stage == Stage::kDense && report.stage_fraction == 1))
        << StageName(report.stage) << " " << report.stage_fraction;
  }
}

TEST_F(HurryTest, StopEndsItAllTheSame) {
  std::stop_source stop;
  std::stop_source hurry;
  hurry.request_stop();
  const auto found = Match(poses_.x, poses_.y, {}, {},
                           {[&](const Progress& report) {
                              if (report.has_map) stop.request_stop();
                            },
                            stop.get_token(), hurry.get_token()});
  EXPECT_THAT(found.status(),
              StatusIs(absl::StatusCode::kCancelled, testing::_));
}

TEST(HurryOfOthersTest, LandmarksAreKept) {
  const TriangleMesh mesh = FiveArms(3);
  std::stop_source hurry;
  hurry.request_stop();
  const std::vector<Landmark> landmarks = {{7, 7}, {60, 61}};
  const auto found =
      Match(mesh, mesh, landmarks, QuickOptions(), {{}, {}, hurry.get_token()});
  ASSERT_THAT(found, IsOk());
  EXPECT_TRUE(found->ended_early);
  EXPECT_EQ(found->y_from_x[7], 7);
  EXPECT_EQ(found->y_from_x[60], 61);
}

TEST(HurryOfOthersTest, LandmarksThatMoveTheMapCostNoRounds) {
  const TriangleMesh mesh = FiveArms(3);
  // One vertex beside the right one.
  const std::vector<Landmark> landmarks = {{7, 7}, {60, 60}, {300, 301}};
  std::stop_source hurry;
  const auto found = Match(mesh, mesh, landmarks, QuickOptions(),
                           {[&](const Progress& report) {
                              if (report.stage == Stage::kAlignment)
                                hurry.request_stop();
                            },
                            {},
                            hurry.get_token()});
  ASSERT_THAT(found, IsOk());
  EXPECT_TRUE(found->ended_early);
  for (const auto& [x, y] : landmarks) EXPECT_EQ(found->y_from_x[x], y);
  EXPECT_GT(FractionRight(found->y_from_x, IdentityMap(mesh.num_vertices())),
            0.95);
}

TEST_F(HurryTest, AMapThatNothingWasLeftOfIsNotEarly) {
  const Correspondence finished = Until(
      [](const Progress& report) { return report.stage == Stage::kQuality; });
  EXPECT_FALSE(finished.ended_early);
}

TEST_F(HurryTest, AMapThatWasNotRefinedIsNotCalledGood) {
  EXPECT_NE(Until(kAtOnce).verdict.level, VerdictLevel::kGood);
}

TEST(HurryOfOthersTest, EveryComponentGetsItsFirstMap) {
  const TriangleMesh one = FiveArms(3);
  const TriangleMesh both =
      Joined(Untouched(one), Untouched(Shifted(Moved(one, 0.5), 9)),
             one.num_vertices())
          .mesh;
  std::vector<Progress> seen;
  const auto found = MatchUntil(both, both, QuickOptions(), kAtOnce, &seen);
  ASSERT_THAT(found, IsOk());
  EXPECT_TRUE(found->ended_early);
  EXPECT_THAT(found->y_from_x, Each(Ge(0)));
  // The first one's is not a whole map yet.
  for (const Progress& report : seen) {
    if (report.has_map) {
      EXPECT_GT(report.total_fraction, 0.5);
    }
  }
  EXPECT_TRUE(seen.back().has_map);
}

TEST(HurryOfOthersTest, PartsAndOverlapsHaveTheirMask) {
  const TriangleMesh whole = FiveArms(4);
  const DirtyMesh part =
      MovedPart(whole, Beyond({-0.5, -0.6, 0.3}, 0.1), /*seed=*/6, 1);
  for (const Relation relation :
       {Relation::kPartOfX, Relation::kOverlap, Relation::kAuto}) {
    MatchOptions options = QuickOptions();
    options.relation = relation;
    options.scale = LengthScale::kSame;
    std::vector<Progress> seen;
    const auto found = MatchUntil(whole, part.mesh, options, kAtOnce, &seen);
    ASSERT_THAT(found, IsOk());
    EXPECT_TRUE(found->ended_early);
    EXPECT_GT(found->quality.unmatched, 0);
    EXPECT_LT(found->quality.unmatched, whole.num_vertices());
    EXPECT_TRUE(seen.back().has_map);
    for (const Progress& report : seen) {
      if (relation == Relation::kOverlap && report.stage == Stage::kChoice) {
        EXPECT_TRUE(!report.has_map || report.stage_fraction == 1);
      }
    }
  }
}

TEST(HurryOfOthersTest, ThePapersProfileHasNoMapBeforeTheLast) {
  MatchOptions options = MatchOptions::ForProfile(Profile::kPaper);
  options.first_stage_matches = 40;
  options.max_seeds = 24;
  options.zoomout_end = 30;
  std::vector<Progress> seen;
  const TriangleMesh mesh = FiveArms(3);
  const auto early = MatchUntil(mesh, mesh, options, kAtOnce, &seen);
  const auto finished = MatchUntil(mesh, mesh, options, kNever, &seen);
  ASSERT_THAT(early, IsOk());
  ASSERT_THAT(finished, IsOk());
  EXPECT_FALSE(early->ended_early);
  EXPECT_EQ(early->y_from_x, finished->y_from_x);
}

}  // namespace
}  // namespace isomatch
