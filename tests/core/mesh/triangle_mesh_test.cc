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

}  // namespace
}  // namespace isomatch
