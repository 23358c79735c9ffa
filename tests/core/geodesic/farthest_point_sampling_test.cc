#include "core/geodesic/farthest_point_sampling.h"

#include <algorithm>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

TEST(FarthestPointsTest, APrefixIsTheResultOfASmallerCount) {
  const DistanceFieldSolver solver(FiveArms(3));
  const auto few = FarthestPoints(solver, 10, {});
  const auto many = FarthestPoints(solver, 60, {});
  ASSERT_THAT(few, IsOk());
  ASSERT_THAT(many, IsOk());
  EXPECT_TRUE(std::equal(few->begin(), few->end(), many->begin()));
}

TEST(FarthestPointsTest, ReturnsEveryVertexOnceWhenAskedForMore) {
  const DistanceFieldSolver solver(UnitSphere(1));
  const auto all = FarthestPoints(solver, 1000, {});
  ASSERT_THAT(all, IsOk());
  const std::set<VertexIndex> distinct(all->begin(), all->end());
  EXPECT_EQ(all->size(), 42u);
  EXPECT_EQ(distinct.size(), 42u);
}

TEST(FarthestPointsTest, EachPointIsFarthestFromThoseBefore) {
  const TriangleMesh mesh = FiveArms(3);
  const DistanceFieldSolver solver(mesh);
  DistanceFieldSolver::Workspace workspace;
  const auto points = FarthestPoints(solver, 12, {});
  ASSERT_THAT(points, IsOk());
  std::vector<float> nearest(mesh.num_vertices(), kUnreachable);
  std::vector<float> field(mesh.num_vertices());
  for (std::size_t i = 0; i < points->size(); ++i) {
    const float farthest = *std::max_element(nearest.begin(), nearest.end());
    if (i > 0) {
      EXPECT_GE(nearest[(*points)[i]], 0.99f * farthest);
    }
    solver.Solve((*points)[i], field.data(), 1, &workspace);
    for (std::size_t v = 0; v < field.size(); ++v) {
      nearest[v] = std::min(nearest[v], field[v]);
    }
  }
}

TEST(FarthestPointsTest, TheFirstFivePointsAreTheTipsOfTheArms) {
  const TriangleMesh mesh = FiveArms(4);
  const DistanceFieldSolver solver(mesh);
  const auto points = FarthestPoints(solver, 5, {});
  ASSERT_THAT(points, IsOk());
  for (const VertexIndex v : *points) {
    EXPECT_GT(mesh.positions.row(v).norm(), 2.2);
  }
}

TEST(FarthestPointsTest, StopsWhenAsked) {
  std::stop_source stop;
  stop.request_stop();
  const DistanceFieldSolver solver(UnitSphere(2));
  EXPECT_THAT(FarthestPoints(solver, 10, stop.get_token()),
              StatusIs(absl::StatusCode::kCancelled, testing::_));
}

}  // namespace
}  // namespace isomatch
