#include "core/geodesic/rim_distance.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::Each;

TEST(RimDistancesTest, InThePlaneTheyAreThoseFromTheNearestSide) {
  const TriangleMesh mesh = PlaneGrid(20, 12, 2, 1.2);
  const std::vector<float> distances =
      RimDistances(mesh, DistanceFieldSolver(mesh));
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    const double x = mesh.positions(v, 0);
    const double y = mesh.positions(v, 1);
    EXPECT_NEAR(distances[v], std::min({x, y, 2 - x, 1.2 - y}), 1e-5);
  }
}

TEST(RimDistancesTest, AClosedSurfaceHasNoRim) {
  const TriangleMesh mesh = UnitSphere(2);
  EXPECT_THAT(RimDistances(mesh, DistanceFieldSolver(mesh)),
              Each(kUnreachable));
}

}  // namespace
}  // namespace isomatch
