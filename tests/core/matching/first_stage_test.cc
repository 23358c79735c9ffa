#include "core/matching/first_stage.h"

#include <algorithm>
#include <cmath>
#include <set>
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

  absl::StatusOr<std::vector<RankedMap>> Run() const {
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
    const auto maps = Run();
    ASSERT_THAT(maps, IsOk());
    ASSERT_EQ(maps->size(), 1u);
    const Matching& matching = maps->front().matching;
    EXPECT_EQ(matching.size(), 60);
    for (const PointMatch& match : matching.Matches()) {
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
  const Matching& objective_map = by_objective->front().matching;
  const Matching& error_map = by_error->front().matching;
  EXPECT_GE(Objective(objective_map), Objective(error_map));
  EXPECT_LE(EmbeddingError(error_map), EmbeddingError(objective_map));
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
  EXPECT_LT(OrientationScore(without->front().matching, x.frames(), y.frames()),
            -0.8);
  EXPECT_GT(OrientationScore(with->front().matching, x.frames(), y.frames()),
            0.8);
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
    const auto maps =
        RunFirstStage({x.pool(), finer.pool(), search_, search_, on_x, on_y},
                      seeds, options_, {}, {});
    ASSERT_THAT(maps, IsOk());
    int same_side = 0;
    for (const PointMatch& match : maps->front().matching.Matches()) {
      same_side += on_x.positions(match.x, 2) * on_y.positions(match.y, 2) > 0;
    }
    EXPECT_EQ(same_side > 30, !reflect) << same_side << " of 60 on their side";
  }
}

TEST_F(FirstStageTest, ASeedLargerThanTheTargetIsKept) {
  options_.matches = 4;
  Seed seed;
  for (int p = 0; p < 20; ++p) seed.push_back({p, p});
  const auto maps = RunFirstStage(Input(), {seed}, options_, {}, {});
  ASSERT_THAT(maps, IsOk());
  EXPECT_EQ(maps->front().matching.Matches(), seed);
}

TEST_F(FirstStageTest, PinnedMatchesStayHoweverWrong) {
  Seed seed = {{3, 40}, {7, 11}};
  for (int p = 50; p < 60; ++p) seed.push_back({p, p});
  options_.pinned = 1;
  options_.swaps.neighbors = 0;
  options_.relocation_neighbors = 16;
  const auto maps = RunFirstStage(Input(), {seed}, options_, {}, {});
  ASSERT_THAT(maps, IsOk());
  const std::vector<PointMatch> matches = maps->front().matching.Matches();
  EXPECT_EQ(matches[0], seed[0]);
  EXPECT_NE(matches[1], seed[1]) << "the other wrong one is repaired";
}

/// A body that is its own mirror image, from both sides of which first maps
/// are found.
class SymmetricFirstStageTest : public FirstStageTest {
 protected:
  SymmetricFirstStageTest()
      : body_(MirrorSymmetricBody(3), 150),
        finer_(MirrorSymmetricBody(4), 150) {
    options_.rounds = {{40, 100}};
    options_.max_results = 2;
  }

  absl::StatusOr<std::vector<RankedMap>> RunOnBody() const {
    return RunOnBody(GenerateSeeds(body_.pool(), finer_.pool(), {6, 3, 0}));
  }

  absl::StatusOr<std::vector<RankedMap>> RunOnBody(
      const std::vector<Seed>& seeds) const {
    return RunFirstStage({body_.pool(), finer_.pool(), search_, search_,
                          body_.frames(), finer_.frames()},
                         seeds, options_, {}, {});
  }

  /// Ten matches of the identity, and as many of the reflection.
  std::vector<Seed> OneOfEachSide() const {
    std::vector<Seed> seeds(2);
    for (int x = 0; x < 10; ++x) {
      Eigen::RowVector3d image = body_.frames().positions.row(x);
      for (Seed& seed : seeds) {
        Eigen::Index y;
        (finer_.frames().positions.rowwise() - image)
            .rowwise()
            .norm()
            .minCoeff(&y);
        seed.push_back({x, static_cast<int>(y)});
        image[2] *= -1;
      }
    }
    return seeds;
  }

  double Orientation(const RankedMap& map) const {
    return OrientationScore(map.matching, body_.frames(), finer_.frames());
  }

  const HashedTestShape body_;
  const HashedTestShape finer_;
};

TEST_F(SymmetricFirstStageTest, BothSidesComeBackAsDistinctMaps) {
  const auto maps = RunOnBody();
  ASSERT_THAT(maps, IsOk());
  ASSERT_EQ(maps->size(), 2u);
  EXPECT_LT(Orientation((*maps)[0]) * Orientation((*maps)[1]), -0.5);
  EXPECT_LE((*maps)[0].badness, (*maps)[1].badness);
}

TEST_F(SymmetricFirstStageTest, ASeedThatIsThereTwiceCountsOnce) {
  const std::vector<Seed> seeds = OneOfEachSide();
  options_.rounds = {{12, 2}};
  options_.swapping = Swapping::kNone;
  for (const std::vector<Seed>& some :
       {std::vector<Seed>{seeds[0], seeds[0], seeds[0], seeds[1]},
        std::vector<Seed>{seeds[1], seeds[1], seeds[1], seeds[0]}}) {
    const auto maps = RunOnBody(some);
    ASSERT_THAT(maps, IsOk());
    ASSERT_EQ(maps->size(), 2u) << "copies of one crowd the other out";
    EXPECT_LT(Orientation((*maps)[0]) * Orientation((*maps)[1]), -0.5);
  }
}

TEST_F(SymmetricFirstStageTest, MirroredRegionsAreGrownAnew) {
  // The identity, but for the end in direction x, which is reflected.
  const Positions& on_x = body_.frames().positions;
  const Positions& on_y = finer_.frames().positions;
  Seed seed;
  std::set<int> taken;
  for (int x = 0; x < body_.pool().size(); ++x) {
    Eigen::RowVector3d image = on_x.row(x);
    if (image[0] > 0.6) image[2] *= -1;
    Eigen::Index y;
    (on_y.rowwise() - image).rowwise().norm().minCoeff(&y);
    if (taken.insert(static_cast<int>(y)).second) {
      seed.push_back({x, static_cast<int>(y)});
    }
  }
  options_.matches = static_cast<int>(seed.size());
  options_.swapping = Swapping::kGreedy;
  options_.orientation_from = 30;
  std::vector<double> scores;
  for (const bool regrow : {false, true}) {
    options_.regrow_mirrored = regrow;
    const auto maps = RunFirstStage({body_.pool(), finer_.pool(), search_,
                                     search_, body_.frames(), finer_.frames()},
                                    {seed}, options_, {}, {});
    ASSERT_THAT(maps, IsOk());
    scores.push_back(Orientation(maps->front()));
    EXPECT_EQ(maps->front().matching.size(), options_.matches);
  }
  EXPECT_LT(scores[0], 0.8);
  EXPECT_GT(scores[1], scores[0] + 0.1);
}

TEST_F(SymmetricFirstStageTest, LandmarksOverruleTheOrientationCue) {
  options_.orientation_from = 30;
  int off_plane = 0;
  while (std::abs(body_.frames().positions(off_plane, 2)) < 0.5) ++off_plane;
  for (const bool mirrored : {false, true}) {
    Eigen::RowVector3d wanted = body_.frames().positions.row(off_plane);
    if (mirrored) wanted[2] *= -1;
    Eigen::Index image;
    (finer_.frames().positions.rowwise() - wanted)
        .rowwise()
        .norm()
        .minCoeff(&image);
    options_.landmarks = {{off_plane, static_cast<int>(image)}};
    const auto maps = RunOnBody();
    ASSERT_THAT(maps, IsOk());
    EXPECT_EQ(Orientation(maps->front()) < 0, mirrored);
    EXPECT_FALSE(maps->front().wrong_side);
    EXPECT_EQ(maps->front().contradiction, 0);
  }
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
