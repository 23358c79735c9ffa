#include "core/mesh/decimation.h"

#include <algorithm>
#include <numbers>
#include <set>
#include <stop_token>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/parallel.h"
#include "core/mesh/clean_mesh.h"
#include "core/mesh/component_topology.h"
#include "core/mesh/mesh_geometry.h"
#include "core/mesh/topology.h"
#include "tests/support/dirty_meshes.h"
#include "tests/support/extreme_meshes.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

VertexIndex EulerCharacteristic(const TriangleMesh& mesh) {
  std::set<std::pair<VertexIndex, VertexIndex>> edges;
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    for (int corner = 0; corner < 3; ++corner) {
      edges.insert(std::minmax(VertexIndex{mesh.faces(f, corner)},
                               VertexIndex{mesh.faces(f, (corner + 1) % 3)}));
    }
  }
  return mesh.num_vertices() - static_cast<VertexIndex>(edges.size()) +
         mesh.num_faces();
}

TEST(DecimateTest, KeepsSomeVerticesWhereTheyAre) {
  const TriangleMesh fine = FiveArms(4);
  const CoarseMesh coarse = *Decimate(fine, 600, {});
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
  const TriangleMesh coarse = Decimate(fine, 600, {})->mesh;
  EXPECT_NEAR(SurfaceArea(coarse), SurfaceArea(fine), 0.03 * SurfaceArea(fine));
  // A closed surface of one piece stays one: V - E + F = 2.
  const CleanMesh clean = Clean(coarse);
  EXPECT_TRUE(clean.warnings.empty());
  EXPECT_EQ(ConnectedComponents(clean.mesh).count, 1);
  EXPECT_EQ(EulerCharacteristic(coarse), 2);
}

TEST(DecimateTest, DoesNotDependOnUnitAndPlace) {
  const TriangleMesh fine = FiveArms(3);
  TriangleMesh moved = fine;
  // Powers of two: the same digits.
  moved.positions *= 1 << 20;
  const CoarseMesh a = *Decimate(fine, 300, {});
  const CoarseMesh b = *Decimate(moved, 300, {});
  EXPECT_EQ(a.fine_from_coarse, b.fine_from_coarse);
  EXPECT_EQ(a.mesh.faces, b.mesh.faces);
}

TEST(DecimateTest, KeepsTheBoundaryOfAnOpenMesh) {
  const TriangleMesh fine = PlaneGrid(60, 40, 3, 2);
  const TriangleMesh coarse = Decimate(fine, 500, {})->mesh;
  EXPECT_LE(coarse.num_vertices(), 560);
  EXPECT_NEAR(SurfaceArea(coarse), 6, 1e-6);
}

TEST(DecimateTest, ManySmallHolesAreClosedAndLargeOnesAreNot) {
  const DirtyMesh cut = WithoutFaces(Untouched(UnitSphere(6)),
                                     Beyond(Eigen::RowVector3d(0, 0, 1), 0.8));
  const TriangleMesh pierced =
      Clean(WithoutFaces(cut, AtRandom(0.1, 1)).mesh).mesh;
  const TriangleMesh coarse = Clean(Decimate(pierced, 1000, {})->mesh).mesh;
  // Where two holes touch, a vertex stays.
  EXPECT_LE(coarse.num_vertices(), 1300);
  // The area below the cut is 2 pi 1.8. With the holes it would be a tenth
  // less, with the cut closed a tenth more.
  EXPECT_NEAR(SurfaceArea(coarse), 3.6 * std::numbers::pi,
              0.03 * 3.6 * std::numbers::pi);
}

TEST(DecimateTest, ManyFinsGo) {
  const TriangleMesh finned =
      WithFins(Untouched(UnitSphere(6)), AtRandom(0.1, 1)).mesh;
  const TriangleMesh coarse =
      Clean(Decimate(Clean(finned).mesh, 1000, {})->mesh).mesh;
  EXPECT_NEAR(coarse.num_vertices(), 1000, 50);
  EXPECT_EQ(DescribeComponents(coarse).front().euler_characteristic, 2);
}

TEST(DecimateTest, ABookWhosePagesAreAllFinsKeepsThem) {
  const CoarseMesh coarse = *Decimate(Clean(Book(10'000)).mesh, 4000, {});
  EXPECT_GE(coarse.mesh.num_vertices(), 4000);
}

TEST(DecimateTest, CoincidingShellsAreDecimatedAsWell) {
  // Two closed surfaces at one place, as a coat modeled twice.
  const TriangleMesh one = FiveArms(4);
  TriangleMesh two;
  two.positions.resize(2 * one.num_vertices(), 3);
  two.positions << one.positions, one.positions;
  two.faces.resize(2 * one.num_faces(), 3);
  two.faces << one.faces, one.faces.array() + VertexIndex{one.num_vertices()};
  EXPECT_NEAR(Decimate(two, 800, {})->mesh.num_vertices(), 800, 40);
}

// Large enough to be decimated patch by patch.
class DecimateLargeTest : public testing::Test {
 protected:
  const TriangleMesh sphere_ = UnitSphere(7);
};

/// Where a border was kept, faces would be as small as those of the fine mesh,
/// and the others larger.
void ExpectEvenFaces(const TriangleMesh& coarse) {
  const double mean = SurfaceArea(coarse) / coarse.num_faces();
  int small = 0;
  for (VertexIndex f = 0; f < coarse.num_faces(); ++f) {
    small += FaceArea(coarse, f) < mean / 8 ? 1 : 0;
    EXPECT_LT(FaceArea(coarse, f), mean * 8);
  }
  EXPECT_LT(small, coarse.num_faces() / 40);
}

TEST_F(DecimateLargeTest, LeavesNoTraceOfPatches) {
  const TriangleMesh coarse = Decimate(sphere_, 2000, {})->mesh;
  EXPECT_NEAR(coarse.num_vertices(), 2000, 40);
  EXPECT_EQ(EulerCharacteristic(coarse), 2);
  ExpectEvenFaces(coarse);
  // A chord of a sphere cut into so many faces is so much shorter at most.
  EXPECT_NEAR(SurfaceArea(coarse), SurfaceArea(sphere_),
              0.003 * SurfaceArea(sphere_));
}

// Patches of patches: 1.3 million faces, of which 1 in 650 is left.
TEST(DecimateVeryLargeTest, LeavesNoTraceOfPatches) {
  const TriangleMesh coarse = Decimate(UnitSphere(8), 1000, {})->mesh;
  EXPECT_NEAR(coarse.num_vertices(), 1000, 20);
  EXPECT_EQ(EulerCharacteristic(coarse), 2);
  ExpectEvenFaces(coarse);
}

TEST_F(DecimateLargeTest, IsTheSameAtAnyThreadCount) {
  CoarseMesh one;
  RunWithThreads(1, [&] { one = *Decimate(sphere_, 1000, {}); });
  CoarseMesh four;
  RunWithThreads(4, [&] { four = *Decimate(sphere_, 1000, {}); });
  EXPECT_EQ(one.fine_from_coarse, four.fine_from_coarse);
  EXPECT_EQ(one.mesh.faces, four.mesh.faces);
}

TEST_F(DecimateLargeTest, LeavesAsManyAsAreAskedFor) {
  EXPECT_NEAR(Decimate(sphere_, 120'000, {})->mesh.num_vertices(), 120'000,
              2'400);
}

TEST_F(DecimateLargeTest, IsCancelled) {
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THAT(Decimate(sphere_, 4000, stop.get_token()),
              StatusIs(absl::StatusCode::kCancelled, testing::_));
}

}  // namespace
}  // namespace isomatch
