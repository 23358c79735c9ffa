#include "core/mesh/clean_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stop_token>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/mesh/mesh_geometry.h"
#include "core/mesh/topology.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::Contains;
using testing::HasSubstr;

/// Every face with corners of its own, as STL files have them.
TriangleMesh Unwelded(const TriangleMesh& mesh) {
  TriangleMesh soup;
  soup.positions.resize(3 * mesh.num_faces(), 3);
  soup.faces.resize(mesh.num_faces(), 3);
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    for (int corner = 0; corner < 3; ++corner) {
      soup.faces(f, corner) = 3 * f + corner;
      soup.positions.row(3 * f + corner) =
          mesh.positions.row(mesh.faces(f, corner));
    }
  }
  return soup;
}

double Volume(const TriangleMesh& mesh) {
  double volume = 0;
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    volume += SignedVolume6(mesh, f, {0, 0, 0}) / 6;
  }
  return volume;
}

TEST(CleanTest, LeavesAGoodMeshAlone) {
  const TriangleMesh mesh = FiveArms(2);
  const CleanMesh clean = Clean(mesh);
  EXPECT_TRUE(clean.oriented);
  EXPECT_TRUE(clean.warnings.empty());
  EXPECT_EQ(clean.mesh.positions, mesh.positions);
  EXPECT_EQ(clean.mesh.faces, mesh.faces);
}

TEST(CleanTest, JoinsTheCornersOfATriangleSoup) {
  const TriangleMesh mesh = UnitSphere(2);
  const CleanMesh clean = Clean(Unwelded(mesh));
  EXPECT_EQ(clean.mesh.num_vertices(), mesh.num_vertices());
  EXPECT_EQ(EdgeFaces(clean.mesh.faces).boundary_edges(), 0);
  EXPECT_THAT(clean.warnings, Contains(HasSubstr("coincide")));
  for (const VertexIndex v : clean.clean_from_original) EXPECT_GE(v, 0);
}

TEST(CleanTest, ClosedSurfacesThatTouchStayApart) {
  // Two tetrahedra that share a corner's place, but no face.
  TriangleMesh two;
  two.positions.resize(8, 3);
  two.positions << Tetrahedron().positions, -Tetrahedron().positions;
  two.faces.resize(8, 3);
  two.faces << Tetrahedron().faces,
      (Tetrahedron().faces.array() + 4).matrix().rowwise().reverse();
  ASSERT_EQ(two.positions.row(0), two.positions.row(4));
  const CleanMesh clean = Clean(two);
  EXPECT_EQ(clean.mesh.num_vertices(), 8);
  EXPECT_EQ(ConnectedComponents(clean.mesh).count, 2);
}

TEST(CleanTest, KeepsTheWayBackForVerticesOnNoFace) {
  TriangleMesh mesh = Tetrahedron();
  Positions with_lone(5, 3);
  with_lone << mesh.positions.topRows(1), Eigen::RowVector3d(7, 7, 7),
      mesh.positions.bottomRows(3);
  mesh.positions = with_lone;
  mesh.faces =
      mesh.faces.unaryExpr([](VertexIndex v) { return v == 0 ? v : v + 1; });
  const CleanMesh clean = Clean(mesh);
  EXPECT_EQ(clean.clean_from_original, (VertexMap{0, kNoVertex, 1, 2, 3}));
  EXPECT_EQ(clean.original_from_clean, (VertexMap{0, 2, 3, 4}));
  EXPECT_THAT(clean.warnings, Contains(HasSubstr("1 vertices are on no face")));
}

TEST(CleanTest, DropsDegenerateAndRepeatedFaces) {
  TriangleMesh mesh = Tetrahedron();
  Faces faces(7, 3);
  faces << mesh.faces, 1, 1, 2, mesh.faces.row(0), mesh.faces(1, 1),
      mesh.faces(1, 0), mesh.faces(1, 2);
  mesh.faces = faces;
  const CleanMesh clean = Clean(mesh);
  EXPECT_EQ(clean.mesh.num_faces(), 4);
  EXPECT_THAT(clean.warnings,
              Contains(HasSubstr("3 degenerate or repeated faces")));
}

TEST(CleanTest, TurnsAnInsideOutMeshOutwards) {
  TriangleMesh mesh = FiveArms(2);
  const double volume = Volume(mesh);
  mesh.faces.col(1).swap(mesh.faces.col(2));
  ASSERT_LT(Volume(mesh), 0);
  const CleanMesh clean = Clean(mesh);
  EXPECT_NEAR(Volume(clean.mesh), volume, 1e-9);
}

TEST(CleanTest, AFlatSheetKeepsTheOrientationOfTheFile) {
  const TriangleMesh sheet = PlaneGrid(7, 5, 2, 1);
  for (const double scale : {0.1, 1.0, 7.0}) {
    EXPECT_EQ(Clean(Moved(sheet, scale)).mesh.faces, sheet.faces);
  }
}

TEST(CleanTest, MakesMixedOrientationConsistent) {
  TriangleMesh mesh = FiveArms(2);
  const double volume = Volume(mesh);
  for (VertexIndex f = 0; f < mesh.num_faces(); f += 3) {
    std::swap(mesh.faces(f, 0), mesh.faces(f, 1));
  }
  const CleanMesh clean = Clean(mesh);
  EXPECT_TRUE(clean.oriented);
  EXPECT_NEAR(Volume(clean.mesh), volume, 1e-9);
}

TEST(CleanTest, SaysThatAMoebiusStripHasNoOrientation) {
  constexpr int kSteps = 12;
  TriangleMesh strip;
  strip.positions.resize(2 * kSteps, 3);
  strip.faces.resize(2 * kSteps, 3);
  for (int i = 0; i < kSteps; ++i) {
    const double angle = 2 * M_PI * i / kSteps;
    for (int side = 0; side < 2; ++side) {
      const double across = side == 0 ? -0.3 : 0.3;
      const double radius = 1 + across * std::cos(angle / 2);
      strip.positions.row(2 * i + side) << radius * std::cos(angle),
          radius * std::sin(angle), across * std::sin(angle / 2);
    }
    // After one turn, top and bottom have changed places.
    const bool last = i + 1 == kSteps;
    const int next_low = last ? 1 : 2 * i + 2;
    const int next_high = last ? 0 : 2 * i + 3;
    strip.faces.row(2 * i) << 2 * i, next_low, 2 * i + 1;
    strip.faces.row(2 * i + 1) << 2 * i + 1, next_low, next_high;
  }
  EXPECT_FALSE(Clean(strip).oriented);
}

TEST(CleanTest, EndsWhenStopped) {
  std::stop_source stop;
  EXPECT_THAT(Clean(FiveArms(1), stop.get_token()), IsOk());
  stop.request_stop();
  EXPECT_THAT(Clean(FiveArms(1), stop.get_token()),
              StatusIs(absl::StatusCode::kCancelled, testing::_));
}

TEST(CleanTest, IsIdempotentAndDoesNotDependOnScale) {
  TriangleMesh mesh = Unwelded(FiveArms(1));
  for (const double scale : {1e-8, 1.0, 1e8}) {
    const CleanMesh once = Clean(Moved(mesh, scale));
    const CleanMesh twice = Clean(once.mesh);
    EXPECT_EQ(once.mesh.num_vertices(), FiveArms(1).num_vertices());
    EXPECT_EQ(once.mesh.faces, twice.mesh.faces);
    EXPECT_EQ(once.mesh.positions, twice.mesh.positions);
  }
}

/// The faces by the original vertices of their corners, each from its smallest
/// one on, sorted.
std::vector<std::array<VertexIndex, 3>> OriginalFaces(const CleanMesh& clean) {
  std::vector<std::array<VertexIndex, 3>> faces;
  faces.reserve(clean.mesh.num_faces());
  for (VertexIndex f = 0; f < clean.mesh.num_faces(); ++f) {
    std::array<VertexIndex, 3> face;
    for (int corner = 0; corner < 3; ++corner) {
      face[corner] = clean.original_from_clean[clean.mesh.faces(f, corner)];
    }
    std::ranges::rotate(face, std::ranges::min_element(face));
    faces.push_back(face);
  }
  std::ranges::sort(faces);
  return faces;
}

/// Of the vertices that each original one has become, the original ones.
VertexMap Representatives(const CleanMesh& clean) {
  VertexMap representatives;
  for (const VertexIndex v : clean.clean_from_original) {
    representatives.push_back(v == kNoVertex ? kNoVertex
                                             : clean.original_from_clean[v]);
  }
  return representatives;
}

double MeanStepAlongEdges(const Faces& faces) {
  return (faces.col(0) - faces.col(1)).cwiseAbs().cast<double>().mean();
}

TEST(CleanTest, InSpatialOrderOnlyTheNumberingDiffers) {
  TriangleMesh mesh = Unwelded(UnitSphere(6));
  mesh.positions.conservativeResize(mesh.num_vertices() + 1, Eigen::NoChange);
  mesh.positions.bottomRows(1).setOnes();  // on no face
  mesh = Relabeled(mesh, RandomPermutation(mesh.num_vertices(), /*seed=*/1));
  const CleanMesh given = Clean(mesh);
  const absl::StatusOr<CleanMesh> ordered = CleanInSpatialOrder(mesh, {});
  ASSERT_THAT(ordered, IsOk());
  EXPECT_EQ(ordered->warnings, given.warnings);
  EXPECT_EQ(Representatives(*ordered), Representatives(given));
  EXPECT_EQ(OriginalFaces(*ordered), OriginalFaces(given));
  EXPECT_EQ(ordered->mesh.positions,
            mesh.positions(ordered->original_from_clean, Eigen::all));
  EXPECT_LT(MeanStepAlongEdges(ordered->mesh.faces),
            0.1 * MeanStepAlongEdges(given.mesh.faces));
}

TEST(CleanTest, SmallMeshesKeepTheirOrder) {
  const TriangleMesh mesh = FiveArms(2);
  const absl::StatusOr<CleanMesh> clean = CleanInSpatialOrder(mesh, {});
  ASSERT_THAT(clean, IsOk());
  EXPECT_EQ(clean->mesh.faces, mesh.faces);
  EXPECT_EQ(clean->original_from_clean, IdentityMap(mesh.num_vertices()));
}

TEST(CleanTest, InSpatialOrderItCancels) {
  std::stop_source stop;
  stop.request_stop();
  for (const int level : {2, 7}) {
    EXPECT_THAT(CleanInSpatialOrder(UnitSphere(level), stop.get_token()),
                StatusIs(absl::StatusCode::kCancelled, testing::_));
  }
}

}  // namespace
}  // namespace isomatch
