#include "core/pipeline/correspondence.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/matcher.h"

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
#include "tests/support/dirty_meshes.h"
#include "tests/support/hashed_test_shape.h"
#include "tests/support/matchers.h"
#include "tests/support/quick_options.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

using Landmarks = std::vector<Landmark>;

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

/// FiveArms and a twisted, relabeled copy.
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
  const TriangleMesh y_ = Relabeled(Moved(Twisted(x_, 0.25), 7), truth_);
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

/// Two copies of FiveArms as core works on them: centered, of area 1.

}  // namespace
}  // namespace isomatch
