#include "core/geodesic/basis_points.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include <gtest/gtest.h>

#include "core/geodesic/field_sweeps.h"
#include "tests/support/hashed_test_shape.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

std::vector<float> FieldFrom(const HashedTestShape& shape, VertexIndex source) {
  DistanceFieldSolver::Workspace workspace;
  std::vector<float> field(shape.mesh().num_vertices());
  shape.solver().Solve(source, field.data(), 1, &workspace);
  return field;
}

TEST(BasisPointsTest, BoundsEncloseTheDistance) {
  const HashedTestShape shape(FiveArms(3), /*pool_size=*/50);
  for (const VertexIndex u : {0, 100, 321, 640}) {
    const std::vector<float> field = FieldFrom(shape, u);
    for (VertexIndex v = 0; v < shape.mesh().num_vertices(); ++v) {
      // The fields themselves are off by up to a percent.
      const double slack = 0.02 * field[v] + 0.02;
      EXPECT_LE(shape.basis().LowerBound(u, v), field[v] + slack);
      EXPECT_GE(shape.basis().UpperBound(u, v), field[v] - slack);
    }
  }
}

TEST(BasisPointsTest, TheLowerBoundIsTightForNearVertices) {
  const HashedTestShape shape(FiveArms(4), /*pool_size=*/50);
  double error = 0;
  int near = 0;
  for (const VertexIndex u : {0, 100, 321, 640, 2000}) {
    const std::vector<float> field = FieldFrom(shape, u);
    for (VertexIndex v = 0; v < shape.mesh().num_vertices(); ++v) {
      if (v == u || field[v] > 1) continue;
      error += std::abs(shape.basis().LowerBound(u, v) - field[v]);
      ++near;
    }
  }
  EXPECT_LT(error / near, 0.03);
}

TEST(BasisPointsTest, BoundsAreExactFromABasisPoint) {
  const HashedTestShape shape(FiveArms(3), /*pool_size=*/50);
  const BasisPoints& basis = shape.basis();
  for (VertexIndex v = 0; v < shape.mesh().num_vertices(); ++v) {
    const float distance = basis.Distance(v, 3);
    EXPECT_GE(basis.LowerBound(basis.points()[3], v), distance);
    EXPECT_LE(basis.UpperBound(basis.points()[3], v), distance);
  }
}

TEST(BasisPointsTest, NearestAreSortedByDistance) {
  const HashedTestShape shape(FiveArms(3), /*pool_size=*/50);
  const BasisPoints& basis = shape.basis();
  const std::vector<int> order = basis.Nearest(77, basis.num_points());
  ASSERT_EQ(static_cast<int>(order.size()), basis.num_points());
  for (std::size_t i = 1; i < order.size(); ++i) {
    EXPECT_LE(basis.Distance(77, order[i - 1]), basis.Distance(77, order[i]));
  }
  EXPECT_EQ(basis.Nearest(77, 3),
            std::vector<int>(order.begin(), order.begin() + 3));
}

TEST(BasisPointsTest, DefaultCountIsTheRootWithinBounds) {
  EXPECT_EQ(BasisPoints::DefaultCount(4), 4);
  EXPECT_EQ(BasisPoints::DefaultCount(100), 16);
  EXPECT_EQ(BasisPoints::DefaultCount(5000), 71);
  EXPECT_EQ(BasisPoints::DefaultCount(1000000), 1000);
}

TEST(BasisPointsTest, FieldsAreTheSolversAtAnySize) {
  // Swept in groups up to FieldSweeps::kMostVertices, one by one above.
  for (const int level : {4, 5}) {
    const DistanceFieldSolver solver(UnitSphere(level));
    ASSERT_EQ(solver.num_vertices() > FieldSweeps::kMostVertices, level == 5);
    std::vector<double> fractions;
    const BasisPoints basis = *BasisPoints::Create(
        solver, {0, 77, 1000, 2000, 5, 2500, 300, 81, 222, 1},
        [&](double fraction) { fractions.push_back(fraction); }, {});
    EXPECT_TRUE(std::ranges::is_sorted(fractions));
    EXPECT_EQ(fractions.back(), 1);
    DistanceFieldSolver::Workspace workspace;
    std::vector<float> field(solver.num_vertices());
    for (int z = 0; z < basis.num_points(); ++z) {
      solver.Solve(basis.points()[z], field.data(), 1, &workspace);
      for (VertexIndex v = 0; v < solver.num_vertices(); ++v) {
        ASSERT_NEAR(basis.Distance(v, z), field[v], 3e-5);
      }
    }
  }
}

TEST(BasisPointsTest, DistancesAmongPointsAreMeansOfBothEndsFields) {
  const std::vector<VertexIndex> points = {0,   77,  1000, 2000, 5,
                                           300, 222, 81,   1,    2500};
  for (const int level : {4, 5}) {
    const DistanceFieldSolver solver(UnitSphere(level));
    const BasisPoints basis = *BasisPoints::Create(solver, points, {}, {});
    const absl::StatusOr<Eigen::MatrixXf> among =
        DistancesAmong(solver, points, {});
    ASSERT_THAT(among, IsOk());
    ASSERT_EQ(among->rows(), std::ssize(points));
    ASSERT_EQ(among->cols(), std::ssize(points));
    for (int i = 0; i < std::ssize(points); ++i) {
      for (int j = 0; j < std::ssize(points); ++j) {
        EXPECT_EQ((*among)(i, j), 0.5f * (basis.Distance(points[i], j) +
                                          basis.Distance(points[j], i)));
      }
    }
  }
}

TEST(BasisPointsTest, CreationStopsWhenAsked) {
  std::stop_source stop;
  stop.request_stop();
  const DistanceFieldSolver solver(UnitSphere(2));
  const auto is_cancelled = StatusIs(absl::StatusCode::kCancelled, testing::_);
  EXPECT_THAT(
      BasisPoints::Create(solver, {0, 1, 2}, {}, stop.get_token()).status(),
      is_cancelled);
  EXPECT_THAT(
      DistancesAmong(solver, std::vector<VertexIndex>{0, 1}, stop.get_token())
          .status(),
      is_cancelled);
}

TEST(EnvironmentsTest, EachVertexIsInThoseOfItsThreeNearestBasisPoints) {
  const HashedTestShape shape(FiveArms(3), /*pool_size=*/50);
  const HashedShape hashed = shape.hashed();
  std::map<int, std::vector<int>> environments_of;
  for (int z = 0; z < shape.basis().num_points(); ++z) {
    for (const int v : hashed.environments[z]) {
      environments_of[v].push_back(z);
    }
  }
  ASSERT_EQ(static_cast<int>(environments_of.size()),
            shape.mesh().num_vertices());
  for (const auto& [v, environments] : environments_of) {
    std::vector<int> nearest = shape.basis().Nearest(v, 3);
    std::sort(nearest.begin(), nearest.end());
    EXPECT_EQ(environments, nearest);
  }
}

}  // namespace
}  // namespace isomatch
