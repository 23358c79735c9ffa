#include "core/pipeline/landmarks.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random_stream.h"
#include "core/evaluation/geodesic_error.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/prepared_mesh.h"
#include "tests/support/dirty_meshes.h"
#include "tests/support/hashed_test_shape.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

using Landmarks = std::vector<Landmark>;

class LandmarkFunctionsTest : public testing::Test {
 protected:
  static WorkingMesh Working(const TriangleMesh& mesh) {
    absl::StatusOr<WorkingMesh> working = MakeWorkingMesh(Clean(mesh), {});
    EXPECT_THAT(working, IsOk());
    return *std::move(working);
  }

  static std::vector<WorkingLandmark> Numbered(const Landmarks& landmarks) {
    std::vector<WorkingLandmark> result;
    for (const Landmark& landmark : landmarks) {
      result.push_back({landmark, result.size()});
    }
    return result;
  }

  Landmarks Agreeing(const Landmarks& landmarks) const {
    return AgreeingLandmarks(Numbered(landmarks), shape_.basis(),
                             shape_.basis());
  }

  /// The first `count` farthest points, matched to themselves.
  Landmarks Spread(int count) const {
    Landmarks landmarks;
    for (int i = 0; i < count; ++i) {
      const VertexIndex v = shape_.basis().points()[i];
      landmarks.push_back({v, v});
    }
    return landmarks;
  }

  const HashedTestShape shape_{Working(FiveArms(3)).mesh, /*pool_size=*/0};
};

TEST_F(LandmarkFunctionsTest, OnesOfAnIsometryAllAgree) {
  EXPECT_THAT(Agreeing({}), IsEmpty());
  for (const int count : {1, 2, 3, 20}) {
    EXPECT_EQ(Agreeing(Spread(count)), Spread(count));
  }
}

TEST_F(LandmarkFunctionsTest, TwoThatDisagreeAreBothReturned) {
  // Far apart on X, next to each other on Y.
  const VertexIndex a = shape_.basis().points()[0];
  const VertexIndex b = shape_.basis().points()[1];
  const auto near_a = [&] {
    for (VertexIndex f = 0; f < shape_.mesh().num_faces(); ++f) {
      for (const int corner : {0, 1, 2}) {
        if (shape_.mesh().faces(f, corner) == a) {
          return shape_.mesh().faces(f, (corner + 1) % 3);
        }
      }
    }
    return kNoVertex;
  }();
  ASSERT_NE(near_a, kNoVertex);
  const Landmarks two = {{a, a}, {b, near_a}};
  EXPECT_EQ(Agreeing(two), two);
}

TEST_F(LandmarkFunctionsTest, SwappedOnesGo) {
  // The first five are tips of arms, about equally far from each other; the
  // sixth is on the trunk.
  Landmarks landmarks = Spread(12);
  std::swap(landmarks[0].y, landmarks[5].y);
  Landmarks rest = landmarks;
  rest.erase(rest.begin() + 5);
  rest.erase(rest.begin());
  EXPECT_EQ(Agreeing(landmarks), rest);
}

TEST_F(LandmarkFunctionsTest, AMinorityThatIsWrongGoesAndNoRightOneWithIt) {
  // Of 20, the first `wrong` go far away, some of them by chance to places as
  // far from the others as the right ones.
  const Positions& positions = shape_.mesh().positions;
  for (const int wrong : {1, 4, 7}) {
    Landmarks landmarks = Spread(20);
    std::rotate(landmarks.begin(), landmarks.begin() + 7, landmarks.end());
    RandomStream random(/*random_seed=*/8, wrong);
    for (int i = 0; i < wrong; ++i) {
      const auto here = positions.row(landmarks[i].x);
      while ((positions.row(landmarks[i].y) - here).norm() < 0.3) {
        landmarks[i].y = random.Below(positions.rows());
      }
    }
    const Landmarks agreeing = Agreeing(landmarks);
    for (int i = wrong; i < 20; ++i) {
      EXPECT_THAT(agreeing, Contains(landmarks[i])) << wrong;
    }
    EXPECT_LE(agreeing.size(), 20u - wrong + wrong / 3) << wrong;
  }
}

TEST(SeedsWithLandmarksTest, WithoutLandmarksSeedsStayAsTheyAre) {
  const std::vector<Seed> generated = {{{0, 1}, {1, 0}}, {{2, 2}}};
  for (const bool exact : {false, true}) {
    EXPECT_EQ(SeedsWithLandmarks({}, generated, exact), generated);
  }
}

TEST(SeedsWithLandmarksTest, TheyComeAloneThenWithEachSeedThatFits) {
  const Seed given = {{0, 5}, {7, 1}};
  // The first has a match that takes a landmark's x, the second one's y.
  const std::vector<Seed> generated = {{{0, 2}, {3, 3}}, {{4, 1}, {6, 6}}};
  EXPECT_THAT(SeedsWithLandmarks(given, generated, /*exact=*/true),
              ElementsAre(given, Seed{{0, 5}, {7, 1}, {3, 3}},
                          Seed{{0, 5}, {7, 1}, {6, 6}}));
  // Unless they are exact, the better half also goes without them.
  EXPECT_THAT(SeedsWithLandmarks(given, generated, /*exact=*/false),
              ElementsAre(given, Seed{{0, 5}, {7, 1}, {3, 3}}, generated[0],
                          Seed{{0, 5}, {7, 1}, {6, 6}}));
}

TEST(SeedsWithLandmarksTest, EverySeedContainsTheLandmarksWhenTheyAreExact) {
  Seed given;
  for (int i = 0; i < 40; ++i) given.push_back({i, 39 - i});
  std::vector<Seed> generated;
  for (int i = 0; i < 300; ++i) generated.push_back({{30 + i, i}, {50 + i, i}});
  for (const bool exact : {true, false}) {
    const auto seeds = SeedsWithLandmarks(given, generated, exact);
    // With many landmarks, fewer seeds than were generated.
    EXPECT_LT(seeds.size(), 100u);
    for (const Seed& seed : seeds) {
      const bool begins = seed.size() >= given.size() &&
                          std::equal(given.begin(), given.end(), seed.begin());
      EXPECT_TRUE(begins || !exact);
      if (!begins) continue;
      std::set<int> xs, ys;
      for (std::size_t i = 0; i < given.size(); ++i) {
        xs.insert(seed[i].x);
        ys.insert(seed[i].y);
      }
      for (std::size_t i = given.size(); i < seed.size(); ++i) {
        EXPECT_EQ(xs.count(seed[i].x) + ys.count(seed[i].y), 0u);
      }
    }
  }
}

class TakeLandmarksTest : public LandmarkFunctionsTest {
 protected:
  static PreparedMesh Prepared(const TriangleMesh& mesh) {
    PreparedMesh prepared;
    EXPECT_THAT(PrepareSurface(Clean(mesh), MatchOptions(), {}, &prepared),
                IsOk());
    return prepared;
  }

  std::vector<std::string> warnings_;
};

TEST_F(TakeLandmarksTest, NamesWorkingVertices) {
  const DirtyMesh lone = WithLoneVertices(Untouched(FiveArms(2)), 4);
  const PreparedMesh x = Prepared(lone.mesh);
  const PreparedMesh y = Prepared(FiveArms(2));
  const Landmarks landmarks = {{2, 17}, {30, 0}};
  const auto taken = TakeLandmarks(landmarks, x, y, &warnings_);
  ASSERT_THAT(taken, IsOk());
  ASSERT_EQ(taken->size(), 2u);
  for (const int i : {0, 1}) {
    EXPECT_EQ(x.full.user_from_working[(*taken)[i].match.x], landmarks[i].x);
    EXPECT_EQ(y.full.user_from_working[(*taken)[i].match.y], landmarks[i].y);
  }
  EXPECT_EQ((*taken)[1].index, 1u);
  EXPECT_THAT(warnings_, IsEmpty());
  EXPECT_THAT(TakeLandmarks(Landmarks{{5, 5}, {1, 3}}, x, y, &warnings_),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("landmarks[1].x")));
  EXPECT_THAT(TakeLandmarks(Landmarks{{5, 0}}, y, x, &warnings_),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("landmarks[0].y")));
}

TEST_F(TakeLandmarksTest, OnesThatCoincideAfterCleaningAreTakenOnce) {
  const DirtyMesh soup = TriangleSoup(Untouched(FiveArms(2)));
  const PreparedMesh x = Prepared(soup.mesh);
  const PreparedMesh y = Prepared(FiveArms(2));
  // Two corners of the soup that are the same vertex.
  const VertexIndex second = [&] {
    VertexIndex v = 1;
    while (soup.origin[v] != soup.origin[0]) ++v;
    return v;
  }();
  const Landmarks landmarks = {{0, 3}, {second, 4}, {1, 5}};
  const auto taken = TakeLandmarks(landmarks, x, y, &warnings_);
  ASSERT_THAT(taken, IsOk());
  ASSERT_EQ(taken->size(), 2u);
  EXPECT_EQ((*taken)[0].index, 0u);
  EXPECT_EQ((*taken)[1].index, 2u);
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("landmarks[1] left out")));
}

TEST_F(TakeLandmarksTest, OfThoseThatShareASolvedVertexAllButOneFollow) {
  MatchOptions options;
  options.solved_vertices = 500;
  PreparedMesh mesh;
  ASSERT_THAT(PrepareSurface(Clean(FiveArms(4)), options, {}, &mesh), IsOk());
  Landmarks landmarks;
  const VertexIndex n = mesh.full.mesh.num_vertices();
  for (VertexIndex v = 0; v < n; v += 3) landmarks.push_back({v, v});
  const auto taken = TakeLandmarks(landmarks, mesh, mesh, &warnings_);
  ASSERT_THAT(taken, IsOk());
  EXPECT_THAT(warnings_, IsEmpty());
  ASSERT_EQ(taken->size(), landmarks.size());
  std::set<VertexIndex> led;
  for (const WorkingLandmark& landmark : *taken) {
    EXPECT_EQ(landmark.match.x, landmark.match.y);
    EXPECT_EQ(led.insert(landmark.match.x).second, !landmark.follows);
  }
  EXPECT_LT(led.size(), landmarks.size());
}

TEST_F(TakeLandmarksTest, MoreThanAThousandAreThinnedOutEvenly) {
  const PreparedMesh mesh = Prepared(FiveArms(4));
  Landmarks landmarks;
  for (VertexIndex v = 0; v < 2500; ++v) landmarks.push_back({v, v});
  const auto taken = TakeLandmarks(landmarks, mesh, mesh, &warnings_);
  ASSERT_THAT(taken, IsOk());
  ASSERT_EQ(taken->size(), 1000u);
  EXPECT_LE((*taken)[0].index, 3u);
  for (std::size_t i = 1; i < taken->size(); ++i) {
    const std::size_t step = (*taken)[i].index - (*taken)[i - 1].index;
    EXPECT_GE(step, 2u);
    EXPECT_LE(step, 3u);
  }
  EXPECT_GE(taken->back().index, 2496u);
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("1000 of 2500 landmarks used")));
}

}  // namespace
}  // namespace isomatch
