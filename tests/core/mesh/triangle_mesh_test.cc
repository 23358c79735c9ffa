#include "core/mesh/triangle_mesh.h"

#include <limits>

#include <gtest/gtest.h>

#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr auto kInvalid = absl::StatusCode::kInvalidArgument;

TEST(ValidateMeshTest, AcceptsShapesOfAnyScale) {
  for (const double scale : {1e-8, 1.0, 1e8}) {
    EXPECT_THAT(ValidateMesh(Moved(Tetrahedron(), scale), "mesh"), IsOk());
  }
}

TEST(ValidateMeshTest, RefusesAMeshWithoutFaces) {
  EXPECT_THAT(ValidateMesh({}, "mesh_x"),
              StatusIs(kInvalid, HasSubstr("mesh_x: 0 vertices")));
  TriangleMesh mesh = Tetrahedron();
  mesh.faces.resize(0, 3);
  EXPECT_THAT(ValidateMesh(mesh, "mesh_y"),
              StatusIs(kInvalid, HasSubstr("0 faces")));
}

TEST(ValidateMeshTest, NamesTheCoordinateThatIsNotFinite) {
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(),
                           std::numeric_limits<double>::infinity()}) {
    TriangleMesh mesh = Tetrahedron();
    mesh.positions(2, 1) = bad;
    EXPECT_THAT(ValidateMesh(mesh, "mesh_x"),
                StatusIs(kInvalid, HasSubstr("coordinate 1 of vertex 2")));
  }
}

TEST(ValidateMeshTest, NamesTheFaceThatIsOutOfRange) {
  for (const VertexIndex bad : {-1, 4}) {
    TriangleMesh mesh = Tetrahedron();
    mesh.faces(3, 2) = bad;
    EXPECT_THAT(ValidateMesh(mesh, "mesh_x"),
                StatusIs(kInvalid, AllOf(HasSubstr("face 3"),
                                         HasSubstr("expected 0 to 3"))));
  }
}

TEST(ValidateMeshTest, RefusesASurfaceWithoutArea) {
  TriangleMesh mesh = Tetrahedron();
  mesh.positions.setOnes();
  EXPECT_THAT(ValidateMesh(mesh, "mesh_x"),
              StatusIs(kInvalid, HasSubstr("surface area is 0")));
  mesh = Moved(Tetrahedron(), 1e200);
  EXPECT_THAT(
      ValidateMesh(mesh, "mesh_x"),
      StatusIs(kInvalid, HasSubstr("expected a positive, finite area")));
}

TEST(ValidateMeshTest, AcceptsASurfaceWhoseSampledFacesHaveNoArea) {
  TriangleMesh mesh = UnitSphere(5);
  // Of 20,480 faces every fifth is looked at first.
  for (VertexIndex f = 0; f < mesh.num_faces(); f += 5) {
    mesh.faces(f, 1) = mesh.faces(f, 0);
  }
  EXPECT_THAT(ValidateMesh(mesh, "mesh_x"), IsOk());
  mesh.faces.col(1) = mesh.faces.col(0);
  EXPECT_THAT(ValidateMesh(mesh, "mesh_x"),
              StatusIs(kInvalid, HasSubstr("surface area is 0")));
}

TEST(ValidateMeshTest, NamesAVertexTooManyEdgesAway) {
  for (const double shift : {0.0, 1e9}) {
    TriangleMesh mesh = UnitSphere(2);
    mesh.positions.row(17) *= 1e5;
    mesh.positions.array() += shift;
    EXPECT_THAT(ValidateMesh(mesh, "mesh_x"), IsOk());
    mesh.positions.row(17) *= 1e9;
    EXPECT_THAT(ValidateMesh(mesh, "mesh_x"),
                StatusIs(kInvalid, AllOf(HasSubstr("mesh_x: vertex 17 lies"),
                                         HasSubstr("median edges"),
                                         HasSubstr("expected at most 1e+07"))));
  }
}

TEST(ValidateMeshTest, AFarVertexOnNoFaceDoesNotMatter) {
  TriangleMesh mesh = UnitSphere(1);
  mesh.positions.conservativeResize(mesh.num_vertices() + 1, Eigen::NoChange);
  mesh.positions.bottomRows(1).setConstant(1e30);
  EXPECT_THAT(ValidateMesh(mesh, "mesh_x"), IsOk());
}

TEST(ValidateMeshTest, RefusesASurfaceWithHardlyAnyAreaForItsExtent) {
  TriangleMesh mesh = PlaneGrid(20, 1, 1, 1e-10);
  EXPECT_THAT(ValidateMesh(mesh, "mesh_x"), IsOk());
  mesh = PlaneGrid(20, 1, 1, 1e-14);
  EXPECT_THAT(ValidateMesh(mesh, "mesh_x"),
              StatusIs(kInvalid, HasSubstr("square root of the surface area")));
}

TEST(ValidateMeshTest, RefusesLengthsWhosePowersAreNoNumbers) {
  EXPECT_THAT(ValidateMesh(Moved(Tetrahedron(), 1e60), "mesh_x"), IsOk());
  EXPECT_THAT(ValidateMesh(Moved(Tetrahedron(), 1e72), "mesh_x"),
              StatusIs(kInvalid, HasSubstr("expected at most 1e+70")));
}

}  // namespace
}  // namespace isomatch
