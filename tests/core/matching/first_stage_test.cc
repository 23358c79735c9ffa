#include "core/matching/first_stage.h"

#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

#include "core/matching/objective.h"
#include "tests/support/hashed_test_shape.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

class FirstStageTest : public testing::Test {
 protected:
  FirstStageTest() : x_(FiveArms(3), /*pool_size=*/150), y_(FiveArms(3), 150) {
    options_.matches = 60;
    options_.rounds = {{12, 40}, {30, 10}};
  }

  FirstStageInput Input() const {
    return {x_.pool(), y_.pool(), search_, search_, x_.frames(), y_.frames()};
  }

  absl::StatusOr<Matching> Run() const {
    return RunFirstStage(Input(),
                         GenerateSeeds(x_.pool(), y_.pool(), {5, 3, 200}),
                         options_, {}, {});
  }

  const HashedTestShape x_;
  const HashedTestShape y_;
  const CandidateSearch search_;
  FirstStageOptions options_;
};

TEST_F(FirstStageTest, MatchesAShapeToItself) {
  for (const Swapping swapping :
       {Swapping::kNone, Swapping::kGreedy, Swapping::kAnnealed}) {
    options_.swapping = swapping;
    const auto matching = Run();
    ASSERT_THAT(matching, IsOk());
    EXPECT_EQ(matching->size(), 60);
    for (const PointMatch& match : matching->Matches()) {
      EXPECT_EQ(match.x, match.y);
    }
  }
}

TEST_F(FirstStageTest, SelectionByTheObjectivePrefersClusters) {
  // On two different shapes the two rankings choose different maps, each the
  // better one by its own measure.
  const HashedTestShape other(BumpySphere(3), /*pool_size=*/150);
  const FirstStageInput input = {x_.pool(), other.pool(), search_,
                                 search_,   x_.frames(),  other.frames()};
  const std::vector<Seed> seeds =
      GenerateSeeds(x_.pool(), other.pool(), {4, 3, 0});
  options_.rounds.clear();
  options_.selection = Selection::kObjective;
  const auto by_objective = RunFirstStage(input, seeds, options_, {}, {});
  options_.selection = Selection::kEmbeddingError;
  const auto by_error = RunFirstStage(input, seeds, options_, {}, {});
  ASSERT_THAT(by_objective, IsOk());
  ASSERT_THAT(by_error, IsOk());
  EXPECT_GE(Objective(*by_objective), Objective(*by_error));
  EXPECT_LE(EmbeddingError(*by_error), EmbeddingError(*by_objective));
}

TEST_F(FirstStageTest, TheOrientationCueTurnsDownMirroredMaps) {
  // A mirror-symmetric body and its mirror image: both the identity and the
  // reflection are isometries, but the one that keeps vertex indices turns the
  // surface inside out.
  const TriangleMesh body = MirrorSymmetricBody(3);
  TriangleMesh reflected = body;
  reflected.positions.col(2) *= -1;
  reflected.faces.col(1).swap(reflected.faces.col(2));
  const HashedTestShape x(body, /*pool_size=*/150);
  const HashedTestShape y(reflected, /*pool_size=*/150);
  const FirstStageInput input = {x.pool(), y.pool(),   search_,
                                 search_,  x.frames(), y.frames()};
  const std::vector<Seed> seeds = GenerateSeeds(x.pool(), y.pool(), {6, 3, 0});
  options_.rounds = {{30, 100}};
  const auto without = RunFirstStage(input, seeds, options_, {}, {});
  options_.orientation_from = 30;
  const auto with = RunFirstStage(input, seeds, options_, {}, {});
  ASSERT_THAT(without, IsOk());
  ASSERT_THAT(with, IsOk());
  EXPECT_LT(OrientationScore(*without, x.frames(), y.frames()), -0.8);
  EXPECT_GT(OrientationScore(*with, x.frames(), y.frames()), 0.8);
}

TEST_F(FirstStageTest, CurvatureDecidesBetweenIsometriesThatAreAlike) {
  // Both the identity and the reflection of a symmetric body are isometries.
  // Curvature that rises across the mirror plane marks the sides; turned round
  // on Y, it asks for the reflection.
  const HashedTestShape x(MirrorSymmetricBody(3), /*pool_size=*/150);
  const HashedTestShape finer(MirrorSymmetricBody(4), /*pool_size=*/150);
  PointFrames on_x = x.frames();
  on_x.curvatures = on_x.positions.col(2);
  PointFrames on_y = finer.frames();
  options_.rounds = {{30, 100}};
  options_.orientation_from = 60;
  options_.curvature_weight = 5;
  const std::vector<Seed> seeds =
      GenerateSeeds(x.pool(), finer.pool(), {6, 3, 0});
  for (const bool reflect : {false, true}) {
    on_y.curvatures = (reflect ? -1 : 1) * finer.frames().positions.col(2);
    // The reflection turns the surface inside out.
    if (reflect) on_y.normals *= -1;
    const auto matching =
        RunFirstStage({x.pool(), finer.pool(), search_, search_, on_x, on_y},
                      seeds, options_, {}, {});
    ASSERT_THAT(matching, IsOk());
    int same_side = 0;
    for (const PointMatch& match : matching->Matches()) {
      same_side += on_x.positions(match.x, 2) * on_y.positions(match.y, 2) > 0;
    }
    EXPECT_EQ(same_side > 30, !reflect) << same_side << " of 60 on their side";
  }
}

TEST_F(FirstStageTest, ASeedLargerThanTheTargetIsKept) {
  options_.matches = 4;
  Seed seed;
  for (int p = 0; p < 20; ++p) seed.push_back({p, p});
  const auto matching = RunFirstStage(Input(), {seed}, options_, {}, {});
  ASSERT_THAT(matching, IsOk());
  EXPECT_EQ(matching->Matches(), seed);
}

TEST_F(FirstStageTest, ProgressRisesToOne) {
  std::vector<double> fractions;
  ASSERT_THAT(
      RunFirstStage(
          Input(), GenerateSeeds(x_.pool(), y_.pool(), {5, 3, 50}), options_,
          [&](double fraction) { fractions.push_back(fraction); }, {}),
      IsOk());
  EXPECT_TRUE(std::is_sorted(fractions.begin(), fractions.end()));
  EXPECT_NEAR(fractions.back(), 1, 1e-9);
}

TEST_F(FirstStageTest, StopsWhenAsked) {
  std::stop_source stop;
  const auto stop_soon = [&](double) { stop.request_stop(); };
  EXPECT_THAT(
      RunFirstStage(Input(), GenerateSeeds(x_.pool(), y_.pool(), {5, 3, 0}),
                    options_, stop_soon, stop.get_token())
          .status(),
      StatusIs(absl::StatusCode::kCancelled, testing::_));
}

}  // namespace
}  // namespace isomatch
