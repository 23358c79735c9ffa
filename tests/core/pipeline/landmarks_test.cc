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
#include "core/pipeline/matcher.h"
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

/// Options that keep the tests quick: fewer seeds, smaller bases.
MatchOptions QuickOptions() {
  MatchOptions options;
  options.first_stage_matches = 80;
  options.seed_points = 5;
  options.max_seeds = 200;
  options.selection_rounds = {{12, 40}, {40, 10}};
  options.pool_size = 400;
  options.alignment_basis = 60;
  return options;
}

double FractionRight(const VertexMap& found, const VertexMap& truth) {
  int right = 0;
  for (std::size_t v = 0; v < truth.size(); ++v) right += found[v] == truth[v];
  return double(right) / double(truth.size());
}

/// `mesh` turned about the z axis by an angle that grows with z: no isometry,
/// but near one.
TriangleMesh Twisted(const TriangleMesh& mesh, double angle_per_length) {
  TriangleMesh result = mesh;
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    const Eigen::RowVector3d p = mesh.positions.row(v);
    const double angle = angle_per_length * p.z();
    result.positions.row(v)
        << std::cos(angle) * p.x() - std::sin(angle) * p.y(),
        std::sin(angle) * p.x() + std::cos(angle) * p.y(), p.z();
  }
  return result;
}

/// The vertex furthest along `direction`.
VertexIndex Tip(const TriangleMesh& mesh, const Eigen::RowVector3d& direction) {
  Eigen::Index tip;
  (mesh.positions * direction.transpose()).maxCoeff(&tip);
  return static_cast<VertexIndex>(tip);
}

/// FiveArms and a twisted, relabelled copy.
class LandmarkMatchTest : public testing::Test {
 protected:
  absl::StatusOr<Correspondence> Run(const Landmarks& landmarks) const {
    return Match(x_, y_, landmarks, options_);
  }

  double Error(const Correspondence& found) const {
    const auto error = meter_.Measure(found.y_from_x, truth_);
    EXPECT_THAT(error, IsOk());
    return error->mean_over_diameter;
  }

  /// `count` right ones, spread evenly over the vertices' numbers.
  Landmarks Right(VertexIndex count) const {
    Landmarks landmarks;
    for (VertexIndex i = 0; i < count; ++i) {
      const VertexIndex x = i * x_.num_vertices() / count;
      landmarks.push_back({x, truth_[x]});
    }
    return landmarks;
  }

  /// Sends each of these landmarks to a random place that is clearly wrong.
  void Spoil(const std::vector<std::size_t>& which, std::uint64_t seed,
             Landmarks* landmarks) const {
    std::set<VertexIndex> used;
    for (const Landmark& landmark : *landmarks) used.insert(landmark.y);
    RandomStream random(seed, /*index=*/0);
    for (const std::size_t i : which) {
      const VertexIndex right = (*landmarks)[i].y;
      VertexIndex wrong = right;
      do {
        wrong = random.Below(y_.num_vertices());
      } while (used.count(wrong) > 0 ||
               (y_.positions.row(wrong) - y_.positions.row(right)).norm() <
                   0.3 * meter_.sqrt_area());
      used.insert(wrong);
      (*landmarks)[i].y = wrong;
    }
  }

  /// Expects those with a wrong y to be reported and all others to be kept.
  void ExpectJudged(const Landmarks& landmarks,
                    const Correspondence& found) const {
    ASSERT_EQ(found.landmarks.size(), landmarks.size());
    int wrong = 0;
    for (std::size_t i = 0; i < landmarks.size(); ++i) {
      const auto [x, y] = landmarks[i];
      const LandmarkOutcome& outcome = found.landmarks[i];
      const bool right = truth_[x] == y;
      EXPECT_EQ(outcome.kept, right) << "landmark " << i;
      EXPECT_EQ(outcome.y_found, found.y_from_x[x]) << "landmark " << i;
      if (right) {
        EXPECT_EQ(found.y_from_x[x], y) << "landmark " << i;
        EXPECT_EQ(outcome.distance, 0) << "landmark " << i;
      } else {
        ++wrong;
        EXPECT_GT(outcome.distance, 0.1) << "landmark " << i;
      }
    }
    if (wrong == 0) {
      EXPECT_THAT(found.warnings, IsEmpty());
    } else {
      EXPECT_THAT(found.warnings,
                  Contains(HasSubstr(std::to_string(wrong) + " of " +
                                     std::to_string(landmarks.size()) +
                                     " landmarks contradict")));
    }
  }

  const MatchOptions options_ = QuickOptions();
  const TriangleMesh x_ = FiveArms(3);
  const VertexMap truth_ = RandomPermutation(x_.num_vertices(), /*seed=*/3);
  const TriangleMesh y_ = Relabelled(Moved(Twisted(x_, 0.25), 7), truth_);
  const GeodesicErrorMeter meter_{y_};
};

TEST_F(LandmarkMatchTest, FewAndManyRightOnesAreKeptExactly) {
  for (const VertexIndex count : {1, 2, 5, 200}) {
    SCOPED_TRACE(count);
    const Landmarks landmarks = Right(count);
    const auto found = Run(landmarks);
    ASSERT_THAT(found, IsOk());
    ExpectJudged(landmarks, *found);
    EXPECT_LT(Error(*found), 0.02);
  }
}

TEST_F(LandmarkMatchTest, OneInFiveWrongDoesNoHarmAndIsReported) {
  const auto without = Run({});
  ASSERT_THAT(without, IsOk());
  for (const std::uint64_t seed : {1, 2, 3}) {
    SCOPED_TRACE(seed);
    Landmarks landmarks = Right(40);
    Spoil({1, 8, 11, 15, 22, 27, 33, 38}, seed, &landmarks);
    const auto found = Run(landmarks);
    ASSERT_THAT(found, IsOk());
    ExpectJudged(landmarks, *found);
    EXPECT_LE(Error(*found), Error(*without) + 0.002);
  }
}

TEST_F(LandmarkMatchTest, OneWrongOfFiveIsReported) {
  Landmarks landmarks = Right(5);
  Spoil({2}, /*seed=*/4, &landmarks);
  const auto found = Run(landmarks);
  ASSERT_THAT(found, IsOk());
  ExpectJudged(landmarks, *found);
  EXPECT_LT(Error(*found), 0.02);
}

TEST_F(LandmarkMatchTest, TwoSwappedOnesAreReported) {
  // The tips of all arms and some others; that of the longest changes places
  // with another.
  const Eigen::RowVector3d arms[] = {{1, 0.1, 0.05},
                                     {0.2, 1, 0.1},
                                     {-0.9, 0.5, 0.1},
                                     {-0.6, -0.9, 0.2},
                                     {0.3, -0.6, 0.9}};
  Landmarks tips;
  for (const Eigen::RowVector3d& arm : arms) {
    const VertexIndex tip = Tip(x_, arm);
    tips.push_back({tip, truth_[tip]});
  }
  const auto run = [&](VertexIndex more, std::size_t other) {
    SCOPED_TRACE(more);
    SCOPED_TRACE(other);
    Landmarks landmarks = tips;
    for (const Landmark& landmark : Right(more)) landmarks.push_back(landmark);
    std::swap(landmarks[0].y, landmarks[other].y);
    const auto found = Run(landmarks);
    ASSERT_THAT(found, IsOk());
    ExpectJudged(landmarks, *found);
    EXPECT_LT(Error(*found), 0.02);
  };
  for (const std::size_t other : {2, 3, 4}) run(5, other);
  for (const std::size_t other : {1, 2, 3, 4}) run(20, other);
}

TEST_F(LandmarkMatchTest, ClusteredOnTheTipOfOneArmTheyLeaveTheRestFree) {
  VertexMap nearest(x_.num_vertices());
  for (VertexIndex v = 0; v < x_.num_vertices(); ++v) nearest[v] = v;
  const Eigen::RowVector3d tip(3.6, 0.36, 0.18);
  std::sort(nearest.begin(), nearest.end(), [&](VertexIndex a, VertexIndex b) {
    return (x_.positions.row(a) - tip).norm() <
           (x_.positions.row(b) - tip).norm();
  });
  Landmarks landmarks;
  for (int i = 0; i < 8; ++i) {
    landmarks.push_back({nearest[i], truth_[nearest[i]]});
  }
  const auto found = Run(landmarks);
  ASSERT_THAT(found, IsOk());
  ExpectJudged(landmarks, *found);
  EXPECT_LT(Error(*found), 0.02);
}

TEST_F(LandmarkMatchTest, ExactOnesAreKeptHoweverWrong) {
  MatchOptions options = QuickOptions();
  options.landmarks_exact = true;
  Landmarks landmarks = Right(20);
  Spoil({0, 3, 7, 12}, /*seed=*/6, &landmarks);
  std::swap(landmarks[5].y, landmarks[15].y);
  const auto forced = Match(x_, y_, landmarks, options);
  ASSERT_THAT(forced, IsOk());
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    EXPECT_EQ(forced->y_from_x[landmarks[i].x], landmarks[i].y) << i;
    EXPECT_TRUE(forced->landmarks[i].kept) << i;
    EXPECT_EQ(forced->landmarks[i].y_found, landmarks[i].y) << i;
  }
  EXPECT_THAT(forced->warnings, Not(Contains(HasSubstr("contradict"))));
  const auto judged = Match(x_, y_, landmarks, QuickOptions());
  ASSERT_THAT(judged, IsOk());
  ExpectJudged(landmarks, *judged);
}

/// MirrorSymmetricBody, and its mirror image in the plane z = 0 as a map.
class LandmarkSideTest : public testing::Test {
 protected:
  LandmarkSideTest() {
    for (VertexIndex v = 0; v < body_.num_vertices(); ++v) {
      const Eigen::RowVector3d p =
          body_.positions.row(v).cwiseProduct(Eigen::RowVector3d(1, 1, -1));
      Eigen::Index nearest;
      EXPECT_LT((body_.positions.rowwise() - p)
                    .rowwise()
                    .squaredNorm()
                    .minCoeff(&nearest),
                1e-12);
      mirror_.push_back(static_cast<VertexIndex>(nearest));
      itself_.push_back(v);
    }
  }

  VertexIndex TipOfLeftArm() const { return Tip(body_, {0.5, -0.6, 0.8}); }

  /// Every 13th vertex on the left side, sent where `truth` has it.
  Landmarks OnesOnTheLeft(const VertexMap& truth) const {
    Landmarks landmarks;
    for (VertexIndex v = 0; v < body_.num_vertices(); v += 13) {
      if (body_.positions(v, 2) > 0.1) landmarks.push_back({v, truth[v]});
    }
    EXPECT_GT(landmarks.size(), 10u);
    return landmarks;
  }

  double MeanError(const VertexMap& found, const VertexMap& truth) const {
    const auto error = GeodesicErrorMeter(body_).Measure(found, truth);
    EXPECT_THAT(error, IsOk());
    return error.ok() ? error->mean_over_diameter : 1;
  }

  VertexMap Find(const Landmarks& landmarks) const {
    const auto found = Match(body_, body_, landmarks, options_);
    EXPECT_THAT(found, IsOk());
    if (!found.ok()) return {};
    for (const Landmark& landmark : landmarks) {
      EXPECT_EQ(found->y_from_x[landmark.x], landmark.y);
    }
    return found->y_from_x;
  }

  MatchOptions options_ = QuickOptions();
  const TriangleMesh body_ = MirrorSymmetricBody(3);
  VertexMap mirror_;
  VertexMap itself_;
};

TEST_F(LandmarkSideTest, OneOnTheLeftArmKeepsTheSide) {
  const VertexIndex left = TipOfLeftArm();
  EXPECT_GT(FractionRight(Find({{left, left}}), itself_), 0.95);
}

TEST_F(LandmarkSideTest, OneOnTheLeftArmChoosesTheOtherSide) {
  const VertexIndex left = TipOfLeftArm();
  const VertexIndex right = mirror_[left];
  ASSERT_NE(left, right);
  EXPECT_LT(MeanError(Find({{left, right}}), mirror_), 0.01);
  EXPECT_LT(MeanError(Find({{left, right}, {right, left}}), mirror_), 0.01);
}

TEST_F(LandmarkSideTest, OnesOnOneSideOnlyBringTheOtherSideAlong) {
  EXPECT_GT(FractionRight(Find(OnesOnTheLeft(itself_)), itself_), 0.95);
  EXPECT_LT(MeanError(Find(OnesOnTheLeft(mirror_)), mirror_), 0.01);
}

/// Two copies of FiveArms as core works on them: centred, of area 1.
class LandmarkFunctionsTest : public testing::Test {
 protected:
  static WorkingMesh Working(const TriangleMesh& mesh) {
    absl::StatusOr<WorkingMesh> working = MakeWorkingMesh(mesh, {});
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
  std::vector<std::string> warnings_;
};

TEST_F(TakeLandmarksTest, NamesWorkingVertices) {
  const DirtyMesh lone = WithLoneVertices(Untouched(FiveArms(2)), 4);
  const WorkingMesh x = Working(lone.mesh);
  const WorkingMesh y = Working(FiveArms(2));
  const Landmarks landmarks = {{2, 17}, {30, 0}};
  const auto taken = TakeLandmarks(landmarks, x, y, &warnings_);
  ASSERT_THAT(taken, IsOk());
  ASSERT_EQ(taken->size(), 2u);
  EXPECT_EQ((*taken)[0].match, (VertexMatch{0, 17}));
  EXPECT_EQ((*taken)[1].match, (VertexMatch{28, 0}));
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
  const WorkingMesh x = Working(soup.mesh);
  const WorkingMesh y = Working(FiveArms(2));
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

TEST_F(TakeLandmarksTest, MoreThanAThousandAreThinnedOutEvenly) {
  const WorkingMesh mesh = Working(FiveArms(4));
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
