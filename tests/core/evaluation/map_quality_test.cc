#include "core/evaluation/map_quality.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/geodesic/farthest_point_sampling.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

BasisPoints BasisOf(const TriangleMesh& mesh) {
  const DistanceFieldSolver solver(mesh);
  return *BasisPoints::Create(solver, *FarthestPoints(solver, 30, {}), {}, {});
}

TEST(MapQualityTest, TheIdentityIsPerfect) {
  const TriangleMesh mesh = FiveArms(3);
  const auto measures =
      MeasureMap(mesh, BasisOf(mesh), mesh,
                 {IdentityMap(mesh.num_vertices()), mesh.positions}, {});
  ASSERT_THAT(measures, IsOk());
  EXPECT_NEAR(measures->geodesic_distortion, 0, 1e-6);
  EXPECT_EQ(measures->coverage, 1);
  EXPECT_NEAR(measures->area_distortion, 0, 1e-12);
  for (const float d : measures->distortions) EXPECT_NEAR(d, 0, 1e-6);
}

TEST(MapQualityTest, AreaDistortionOfAStretchIsItsLogarithm) {
  const TriangleMesh plane = PlaneGrid(10, 10, 1, 1);
  Positions stretched = plane.positions;
  stretched.col(0) *= 2;
  const auto measures =
      MeasureMap(plane, BasisOf(plane), plane,
                 {IdentityMap(plane.num_vertices()), stretched}, {});
  ASSERT_THAT(measures, IsOk());
  EXPECT_NEAR(measures->area_distortion, std::log(2.0), 1e-9);
}

TEST(MapQualityTest, CoverageIsTheAreaThatImagesReach) {
  // Everything goes to the left half of the plane.
  const TriangleMesh plane = PlaneGrid(40, 40, 1, 1);
  VertexMap map = IdentityMap(plane.num_vertices());
  for (VertexIndex v = 0; v < plane.num_vertices(); ++v) {
    if (v % 41 > 20) map[v] = v - v % 41 + 20;
  }
  const auto measures = MeasureMap(plane, BasisOf(plane), plane,
                                   {map, plane.positions(map, Eigen::all)}, {});
  ASSERT_THAT(measures, IsOk());
  EXPECT_GT(measures->coverage, 0.5);
  EXPECT_LT(measures->coverage, 0.6);
}

TEST(MapQualityTest, DistortionsPointAtTheVerticesThatWentAstray) {
  const TriangleMesh mesh = FiveArms(3);
  VertexMap map = IdentityMap(mesh.num_vertices());
  Eigen::Index tip;
  mesh.positions.rowwise().norm().maxCoeff(&tip);
  const auto astray = static_cast<VertexIndex>(tip);
  map[astray] = 0;
  const auto measures = MeasureMap(mesh, BasisOf(mesh), mesh,
                                   {map, mesh.positions(map, Eigen::all)}, {});
  ASSERT_THAT(measures, IsOk());
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    if (v != astray) {
      EXPECT_LT(measures->distortions[v], measures->distortions[astray]);
    }
  }
}

}  // namespace
}  // namespace isomatch
