#include "core/mesh/component_topology.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "core/mesh/clean_mesh.h"
#include "core/mesh/mesh_geometry.h"
#include "tests/support/dirty_meshes.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

/// The only component of a mesh.
ComponentTopology Only(const TriangleMesh& mesh) {
  const std::vector<ComponentTopology> found =
      DescribeComponents(Clean(mesh).mesh);
  EXPECT_EQ(found.size(), 1u);
  return found.at(0);
}

/// A strip of 8 squares whose ends are joined, turned over when `twisted`.
TriangleMesh Strip(bool twisted) {
  constexpr int kSquares = 8;
  TriangleMesh mesh;
  mesh.positions.resize(2 * kSquares, 3);
  mesh.faces.resize(2 * kSquares, 3);
  for (int i = 0; i < kSquares; ++i) {
    const double turn = 2 * std::numbers::pi * i / kSquares;
    const double tilt = twisted ? turn / 2 : 0;
    for (int side = 0; side < 2; ++side) {
      const double across = side == 0 ? -0.5 : 0.5;
      const double radius = 2 + across * std::sin(tilt);
      mesh.positions.row(2 * i + side) << radius * std::cos(turn),
          radius * std::sin(turn), across * std::cos(tilt);
    }
    const bool last = i + 1 == kSquares;
    const int low = last ? (twisted ? 1 : 0) : 2 * i + 2;
    const int high = last ? (twisted ? 0 : 1) : 2 * i + 3;
    mesh.faces.row(2 * i) << 2 * i, low, 2 * i + 1;
    mesh.faces.row(2 * i + 1) << 2 * i + 1, low, high;
  }
  return mesh;
}

TEST(ComponentTopologyTest, ASphereIsClosedAndHasNoHandle) {
  const TriangleMesh sphere = UnitSphere(2);
  const ComponentTopology found = Only(sphere);
  EXPECT_EQ(found.vertices, sphere.num_vertices());
  EXPECT_EQ(found.faces, sphere.num_faces());
  EXPECT_EQ(found.euler_characteristic, 2);
  EXPECT_EQ(found.boundary_loops, 0);
  EXPECT_EQ(found.Genus(), 0);
  EXPECT_DOUBLE_EQ(found.area, SurfaceArea(sphere));
}

TEST(ComponentTopologyTest, ATorusHasAHandle) {
  const ComponentTopology found = Only(Torus(12, 8));
  EXPECT_EQ(found.euler_characteristic, 0);
  EXPECT_EQ(found.Genus(), 1);
}

TEST(ComponentTopologyTest, RimsAreCounted) {
  const DirtyMesh sphere = Untouched(UnitSphere(3));
  const DirtyMesh cut = WithoutLoneVertices(WithoutFaces(
      WithoutFaces(sphere, Beyond({0, 0, 1}, 0.8)), Beyond({0, 0, -1}, 0.8)));
  const ComponentTopology found = Only(cut.mesh);
  EXPECT_EQ(found.boundary_loops, 2);
  EXPECT_EQ(found.euler_characteristic, 0);
  EXPECT_EQ(found.Genus(), 0);
}

TEST(ComponentTopologyTest, AMoebiusStripHasOneRimAndNoGenus) {
  EXPECT_EQ(Only(Strip(false)).boundary_loops, 2);
  EXPECT_TRUE(Only(Strip(false)).is_oriented);
  const ComponentTopology moebius = Only(Strip(true));
  EXPECT_EQ(moebius.boundary_loops, 1);
  EXPECT_EQ(moebius.euler_characteristic, 0);
  EXPECT_FALSE(moebius.is_oriented);
  EXPECT_EQ(moebius.Genus(), std::nullopt);
}

TEST(ComponentTopologyTest, LargerComponentsComeFirst) {
  const TriangleMesh sphere = UnitSphere(1);
  const DirtyMesh two =
      Joined(Untouched(sphere), Untouched(Moved(sphere, 3)), 100);
  const std::vector<ComponentTopology> found =
      DescribeComponents(Clean(two.mesh).mesh);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_NEAR(found[0].area / found[1].area, 9, 1e-9);
  EXPECT_EQ(found[0].euler_characteristic, 2);
  EXPECT_EQ(found[1].euler_characteristic, 2);
}

TEST(ComponentTopologyTest, AFinIsOneEdgeOfThreeFaces) {
  // One face on one edge of a tetrahedron: a vertex, two edges, a face more.
  TriangleMesh mesh = Tetrahedron();
  mesh.positions.conservativeResize(5, Eigen::NoChange);
  mesh.positions.row(4) << 5, 5, 5;
  mesh.faces.conservativeResize(5, Eigen::NoChange);
  mesh.faces.row(4) << 0, 1, 4;
  const ComponentTopology found = Only(mesh);
  EXPECT_EQ(found.euler_characteristic, 2);
  EXPECT_FALSE(found.is_manifold);
  EXPECT_EQ(found.Genus(), std::nullopt);
}

TEST(ComponentTopologyTest, SheetsThatTouchInAVertexAreNotManifold) {
  TriangleMesh bow_tie;
  bow_tie.positions.resize(5, 3);
  bow_tie.positions << 0, 0, 0, 1, 0, 0, 1, 1, 0, -1, 0, 0, -1, -1, 0;
  bow_tie.faces.resize(2, 3);
  bow_tie.faces << 0, 1, 2, 0, 3, 4;
  EXPECT_FALSE(Only(bow_tie).is_manifold);
}

}  // namespace
}  // namespace isomatch
