// Where a map of a part begins.

#include "core/pipeline/part_start.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "core/descriptor/point_differences.h"
#include "core/geodesic/distance_field_solver.h"
#include "core/geodesic/rim_distance.h"
#include "core/matching/alike_seeds.h"
#include "core/mesh/clean_mesh.h"
#include "core/pipeline/preparation.h"
#include "core/pipeline/progress_reporter.h"
#include "core/pipeline/stage_plan.h"
#include "tests/support/dirty_meshes.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

/// A part of BumpySphere, in its unit, and all of it.
class PartStartTest : public testing::Test {
 protected:
  void Find(int levels, const FacePredicate& is_cut_off) {
    options_.relation = Relation::kPartOfY;
    options_.scale = LengthScale::kSame;
    const TriangleMesh whole = BumpySphere(levels);
    const DirtyMesh part =
        WithoutLoneVertices(WithoutFaces(Untouched(whole), is_cut_off));
    ProgressReporter silent({}, StagePlan(options_));
    ASSERT_THAT(PrepareMeshes({MeshToPrepare{Clean(part.mesh), "mesh_x"},
                               MeshToPrepare{Clean(whole), "mesh_y"}},
                              options_, &silent, {}, &shapes_),
                IsOk());
    auto start = FindPartStart(shapes_[kX], shapes_[kY], {}, options_,
                               {[](double) {}, {}});
    ASSERT_THAT(start, IsOk());
    start_ = *std::move(start);
  }

  /// Nowhere far from the rim. Its edges are so short that they do not ask for
  /// larger balls.
  void FindInBand() {
    const FacePredicate above = Beyond({0, 0, 1}, 0.15);
    const FacePredicate below = Beyond({0, 0, -1}, 0.15);
    Find(5, [&](const TriangleMesh& mesh, VertexIndex f) {
      return above(mesh, f) || below(mesh, f);
    });
  }

  std::vector<float> RimDistancesOf(Side side) const {
    const TriangleMesh& mesh = shapes_[side].solved().mesh;
    return RimDistances(mesh, DistanceFieldSolver(mesh, {}));
  }

  /// In units of Y.
  double MeanRimDistance() const {
    const std::vector<float> distances = RimDistancesOf(kX);
    double sum = 0;
    for (const VertexIndex v : start_.pools[kX]) sum += distances[v];
    return start_.scale * sum / static_cast<double>(start_.pools[kX].size());
  }

  /// How unlike the points look by balls of this radius, and of twice that.
  Eigen::MatrixXf DifferencesWith(double radius) const {
    std::array<PointDescriptors, 2> described;
    for (const Side side : {kX, kY}) {
      const double unit = side == kX ? 1 / start_.scale : 1;
      const std::array<ShotBall, 2> balls = {
          ShotBall{radius * unit, kFacing},
          ShotBall{2 * radius * unit, kFacing}};
      auto found = DescribePoints(SurfaceOf(shapes_[side]), start_.pools[side],
                                  RimDistancesOf(side), balls, {});
      EXPECT_THAT(found, IsOk());
      described[side] = *std::move(found);
    }
    return PointDifferences(described[kX], described[kY]);
  }

  MatchOptions options_;
  std::array<PreparedMesh, 2> shapes_;
  PartStart start_;
};

TEST_F(PartStartTest, SeedsAreMadeOfPointsFarFromARimThatIsNear) {
  FindInBand();
  const std::vector<float> distances = RimDistancesOf(kX);
  const auto count = static_cast<std::size_t>(AlikeSeedOptions().points_x);
  const std::vector<VertexIndex>& pool = start_.pools[kX];
  ASSERT_GT(pool.size(), count);
  const auto is_nearer = [&](VertexIndex a, VertexIndex b) {
    return distances[a] < distances[b];
  };
  const auto middle = pool.begin() + static_cast<std::ptrdiff_t>(count);
  EXPECT_GE(distances[*std::min_element(pool.begin(), middle, is_nearer)],
            distances[*std::max_element(middle, pool.end(), is_nearer)]);
  ASSERT_FALSE(start_.seeds.empty());
  for (const Seed& seed : start_.seeds) {
    for (const PointMatch& match : seed) {
      EXPECT_LT(match.x, static_cast<int>(count));
    }
  }
}

TEST_F(PartStartTest, BallsAreLargerWhereTheRimCutsNearlyAll) {
  Find(4, Beyond({0, 0, -1}, 0));
  ASSERT_GT(MeanRimDistance(), 0.08);
  EXPECT_FALSE(start_.is_mostly_rim);
  EXPECT_TRUE(start_.differences.isApprox(DifferencesWith(0.08)));
  FindInBand();
  ASSERT_LT(MeanRimDistance(), 0.05);
  EXPECT_TRUE(start_.is_mostly_rim);
  EXPECT_TRUE(start_.differences.isApprox(DifferencesWith(0.12)));
}

}  // namespace
}  // namespace isomatch
