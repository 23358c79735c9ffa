#include "core/mesh/decimation.h"

#include <algorithm>
#include <set>

#include <gtest/gtest.h>

#include "core/mesh/clean_mesh.h"
#include "core/mesh/mesh_geometry.h"
#include "core/mesh/topology.h"
#include "tests/support/dirty_meshes.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

TEST(DecimateTest, KeepsSomeVerticesWhereTheyAre) {
  const TriangleMesh fine = FiveArms(4);
  const CoarseMesh coarse = Decimate(fine, 600);
  ASSERT_EQ(coarse.fine_from_coarse.size(),
            static_cast<std::size_t>(coarse.mesh.num_vertices()));
  EXPECT_TRUE(std::is_sorted(coarse.fine_from_coarse.begin(),
                             coarse.fine_from_coarse.end()));
  for (VertexIndex c = 0; c < coarse.mesh.num_vertices(); ++c) {
    EXPECT_EQ(coarse.mesh.positions.row(c),
              fine.positions.row(coarse.fine_from_coarse[c]));
  }
  EXPECT_NEAR(coarse.mesh.num_vertices(), 600, 12);
}

TEST(DecimateTest, KeepsTheShape) {
  const TriangleMesh fine = FiveArms(4);
  const TriangleMesh coarse = Decimate(fine, 600).mesh;
  EXPECT_NEAR(SurfaceArea(coarse), SurfaceArea(fine), 0.03 * SurfaceArea(fine));
  // A closed surface of one piece stays one: V - E + F = 2.
  const CleanMesh clean = Clean(coarse);
  EXPECT_TRUE(clean.warnings.empty());
  EXPECT_EQ(ConnectedComponents(clean.mesh).count, 1);
  std::set<std::pair<VertexIndex, VertexIndex>> edges;
  for (VertexIndex f = 0; f < coarse.num_faces(); ++f) {
    for (int corner = 0; corner < 3; ++corner) {
      edges.insert(std::minmax(VertexIndex{coarse.faces(f, corner)},
                               VertexIndex{coarse.faces(f, (corner + 1) % 3)}));
    }
  }
  EXPECT_EQ(coarse.num_vertices() - static_cast<int>(edges.size()) +
                coarse.num_faces(),
            2);
}

TEST(DecimateTest, DoesNotDependOnUnitAndPlace) {
  const TriangleMesh fine = FiveArms(3);
  TriangleMesh moved = fine;
  // Powers of two: the same digits.
  moved.positions *= 1 << 20;
  const CoarseMesh a = Decimate(fine, 300);
  const CoarseMesh b = Decimate(moved, 300);
  EXPECT_EQ(a.fine_from_coarse, b.fine_from_coarse);
  EXPECT_EQ(a.mesh.faces, b.mesh.faces);
}

TEST(DecimateTest, KeepsTheBoundaryOfAnOpenMesh) {
  const TriangleMesh fine = PlaneGrid(60, 40, 3, 2);
  const TriangleMesh coarse = Decimate(fine, 500).mesh;
  EXPECT_LE(coarse.num_vertices(), 560);
  EXPECT_NEAR(SurfaceArea(coarse), 6, 1e-6);
}

TEST(DecimateTest, CoincidingShellsAreDecimatedAsWell) {
  // Two closed surfaces at one place, as a coat modelled twice.
  const TriangleMesh one = FiveArms(4);
  TriangleMesh two;
  two.positions.resize(2 * one.num_vertices(), 3);
  two.positions << one.positions, one.positions;
  two.faces.resize(2 * one.num_faces(), 3);
  two.faces << one.faces, one.faces.array() + VertexIndex{one.num_vertices()};
  EXPECT_NEAR(Decimate(two, 800).mesh.num_vertices(), 800, 40);
}

}  // namespace
}  // namespace isomatch
