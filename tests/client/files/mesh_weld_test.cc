#include "client/files/mesh_weld.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/mesh/clean_mesh.h"
#include "core/mesh/topology.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::HasSubstr;

constexpr auto kInvalid = absl::StatusCode::kInvalidArgument;

/// Every face for itself, its corners off by less than `error`.
TriangleMesh Soup(const TriangleMesh& mesh, double error) {
  TriangleMesh soup = {Positions(3 * mesh.num_faces(), 3),
                       Faces(mesh.num_faces(), 3)};
  for (VertexIndex v = 0; v < soup.num_vertices(); ++v) {
    soup.faces(v / 3, v % 3) = v;
    soup.positions.row(v) =
        mesh.positions.row(mesh.faces(v / 3, v % 3)) +
        error / 2 * Eigen::RowVector3d(v % 7 / 7.0, v % 5 / 5.0, v % 3 / 3.0);
  }
  return soup;
}

WeldTolerance Tolerance(const std::string& text) {
  const absl::StatusOr<WeldTolerance> tolerance = ParseWeldTolerance(text);
  EXPECT_THAT(tolerance, IsOk());
  return *tolerance;
}

TEST(WeldToleranceTest, IsALengthOrAPartOfTheDiagonal) {
  const TriangleMesh square = PlaneGrid(2, 2, 3, 4);
  EXPECT_EQ(Tolerance("1e-6").LengthFor(square), 1e-6);
  EXPECT_DOUBLE_EQ(Tolerance("0.1%").LengthFor(square), 0.005);
  for (const char* bad :
       {"", "%", "0", "-1", "nan", "inf", "11%", "1e-6m", "inf%"}) {
    EXPECT_THAT(ParseWeldTolerance(bad),
                StatusIs(kInvalid, HasSubstr("--weld")))
        << bad;
  }
}

TEST(WeldVerticesTest, ASoupBecomesItsSurfaceAtAnyScale) {
  const TriangleMesh sphere = BumpySphere(3);
  for (const double scale : {1e-8, 1.0, 1e8}) {
    TriangleMesh soup = Moved(Soup(sphere, 1e-6), scale);
    const VertexIndex vertices = soup.num_vertices();
    ASSERT_GT(ConnectedComponents(Clean(soup).mesh).count, 1000);
    ASSERT_THAT(WeldVertices(Tolerance("0.0001%"), &soup), IsOk());
    EXPECT_EQ(soup.num_vertices(), vertices);
    const CleanMesh clean = Clean(soup);
    EXPECT_EQ(clean.mesh.num_vertices(), sphere.num_vertices());
    EXPECT_EQ(clean.mesh.num_faces(), sphere.num_faces());
    EXPECT_EQ(ConnectedComponents(clean.mesh).count, 1);
    // Each has a place in the clean mesh.
    EXPECT_THAT(clean.clean_from_original, testing::Each(testing::Ge(0)));
  }
}

TEST(WeldVerticesTest, ShortEdgesInsideTheSurfaceGo) {
  TriangleMesh sphere = UnitSphere(3);
  const VertexIndex a = sphere.faces(5, 0);
  const VertexIndex b = sphere.faces(5, 1);
  sphere.positions.row(b) = sphere.positions.row(a) * (1 + 1e-7);
  const VertexIndex vertices = sphere.num_vertices();
  const VertexIndex faces = sphere.num_faces();
  EXPECT_EQ(*WeldVertices(Tolerance("1e-6"), &sphere), 1);
  EXPECT_EQ(sphere.num_vertices(), vertices);
  EXPECT_EQ(sphere.num_faces(), faces - 2);
  const CleanMesh clean = Clean(sphere);
  EXPECT_EQ(clean.clean_from_original[static_cast<std::size_t>(a)],
            clean.clean_from_original[static_cast<std::size_t>(b)]);
  EXPECT_EQ(EdgeFaces(clean.mesh.faces).boundary_edges(), 0);
}

// A tolerance above an edge leaves vertices inside without a face.
TEST(WeldVerticesTest, VerticesWithoutAFaceGoWhereTheyWereMoved) {
  TriangleMesh sphere = UnitSphere(4);
  ASSERT_THAT(WeldVertices(Tolerance("6%"), &sphere), IsOk());
  const CleanMesh clean = Clean(sphere);
  EXPECT_LT(clean.mesh.num_vertices(), sphere.num_vertices() / 4);
  for (VertexIndex v = 0; v < sphere.num_vertices(); ++v) {
    const VertexIndex kept =
        clean.clean_from_original[static_cast<std::size_t>(v)];
    ASSERT_GE(kept, 0) << v;
    EXPECT_EQ(clean.mesh.positions.row(kept), sphere.positions.row(v)) << v;
  }
}

TEST(WeldVerticesTest, WhatIsLeftWithoutAreaIsRefused) {
  // A flat face, and a small one beside it.
  TriangleMesh mesh = {Positions(6, 3), Faces(2, 3)};
  mesh.positions << 0, 0, 0, 1, 0, 0, 2, 0, 0, 0, 1, 0, 1e-4, 1, 0, 0, 1.0001,
      0;
  mesh.faces << 0, 1, 2, 3, 4, 5;
  EXPECT_THAT(ValidateMesh(mesh, "mesh"), IsOk());
  EXPECT_THAT(WeldVertices(Tolerance("0.001"), &mesh),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       testing::HasSubstr("--weld 0.001: surface area is 0")));
}

TEST(WeldVerticesTest, NothingNearIsLeftAlone) {
  TriangleMesh sphere = BumpySphere(2);
  const TriangleMesh before = sphere;
  EXPECT_EQ(*WeldVertices(Tolerance("1e-6"), &sphere), 0);
  EXPECT_EQ(sphere.positions, before.positions);
  EXPECT_EQ(sphere.faces, before.faces);
  EXPECT_THAT(WeldVertices(Tolerance("5"), &sphere),
              StatusIs(kInvalid, HasSubstr("more than a tenth")));
}

TEST(AdviseWeldTest, SaysWhatJoinsASoup) {
  const TriangleMesh sphere = BumpySphere(3);
  TriangleMesh soup = Soup(sphere, 1e-6);
  const std::optional<WeldAdvice> advice = AdviseWeld(soup);
  ASSERT_TRUE(advice.has_value());
  // Few corners happen to agree.
  EXPECT_GT(advice->components, 1200);
  EXPECT_EQ(advice->close, advice->components);
  EXPECT_LE(advice->tolerance, 1e-5);
  EXPECT_THAT(advice->Text(),
              HasSubstr(" of another: probably a triangle soup; try --weld "));
  ASSERT_THAT(WeldVertices({advice->tolerance, false}, &soup), IsOk());
  EXPECT_EQ(ConnectedComponents(Clean(soup).mesh).count, 1);
  EXPECT_FALSE(AdviseWeld(soup).has_value());
}

TEST(AdviseWeldTest, SoupsOfEqualCornersAndManyBodiesAreFine) {
  EXPECT_FALSE(AdviseWeld(Soup(BumpySphere(3), 0)).has_value());
  EXPECT_FALSE(AdviseWeld(BumpySphere(3)).has_value());
  // Thirty spheres apart.
  const TriangleMesh sphere = UnitSphere(1);
  const VertexIndex n = sphere.num_vertices();
  TriangleMesh many = {Positions(30 * n, 3), Faces(30 * sphere.num_faces(), 3)};
  for (int i = 0; i < 30; ++i) {
    many.positions.middleRows(i * n, n) =
        sphere.positions.rowwise() + Eigen::RowVector3d(3.0 * i, 0, 0);
    many.faces.middleRows(i * sphere.num_faces(), sphere.num_faces()) =
        sphere.faces.array() + i * n;
  }
  EXPECT_FALSE(AdviseWeld(many).has_value());
}

}  // namespace
}  // namespace isomatch
