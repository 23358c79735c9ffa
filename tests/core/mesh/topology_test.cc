#include "core/mesh/topology.h"

#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random_stream.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

TEST(EdgeFacesTest, OppositeOfOppositeIsTheSideItself) {
  const TriangleMesh sphere = UnitSphere(2);
  const EdgeFaces edges(sphere.faces);
  EXPECT_EQ(edges.boundary_edges(), 0);
  for (VertexIndex f = 0; f < sphere.num_faces(); ++f) {
    for (int corner = 0; corner < 3; ++corner) {
      const auto other = edges.Opposite(f, corner);
      ASSERT_NE(other.face, kNoVertex);
      EXPECT_NE(other.face, f);
      const auto back = edges.Opposite(other.face, other.corner);
      EXPECT_EQ(back.face, f);
      EXPECT_EQ(back.corner, corner);
      // Both faces of a consistently oriented surface run oppositely.
      EXPECT_EQ(sphere.faces(f, corner),
                sphere.faces(other.face, (other.corner + 1) % 3));
    }
  }
}

TEST(EdgeFacesTest, CountsTheRimOfARectangle) {
  const TriangleMesh plane = PlaneGrid(5, 3, 1, 1);
  EXPECT_EQ(EdgeFaces(plane.faces).boundary_edges(), 2 * (5 + 3));
}

TEST(EdgeFacesTest, ThreeFacesAtAnEdgeAreNonManifold) {
  Faces fan(3, 3);
  fan << 0, 1, 2, 0, 1, 3, 0, 1, 4;
  const EdgeFaces edges(fan);
  EXPECT_EQ(edges.nonmanifold_edges(), 1);
  EXPECT_EQ(edges.boundary_edges(), 6);
  EXPECT_EQ(edges.Opposite(0, 0).face, kNoVertex);
}

/// The slow way: every side against every other.
TEST(EdgeFacesTest, AgreesWithComparingAllSidesOnARandomSoup) {
  constexpr int kFaces = 150;
  constexpr int kVertices = 25;  // edges of one, two and more faces
  RandomStream random(/*seed=*/1, 0);
  Faces soup(kFaces, 3);
  for (Eigen::Index i = 0; i < soup.size(); ++i) {
    soup.data()[i] = random.Below(kVertices);
  }
  const auto edge = [&](int side) {
    return std::minmax(
        {soup(side / 3, side % 3), soup(side / 3, (side % 3 + 1) % 3)});
  };
  const EdgeFaces edges(soup);
  int boundary = 0;
  for (int side = 0; side < 3 * kFaces; ++side) {
    std::vector<int> others;
    for (int other = 0; other < 3 * kFaces; ++other) {
      if (other != side && edge(other) == edge(side)) others.push_back(other);
    }
    const auto found = edges.Opposite(side / 3, side % 3);
    EXPECT_EQ(found.face, others.size() == 1 ? others[0] / 3 : kNoVertex);
    EXPECT_EQ(found.corner, others.size() == 1 ? others[0] % 3 : 0);
    EXPECT_EQ(edges.IsBoundary(side / 3, side % 3), others.empty());
    boundary += others.empty();
  }
  EXPECT_EQ(edges.boundary_edges(), boundary);
  EXPECT_GT(edges.nonmanifold_edges(), 0);
}

TEST(ConnectedComponentsTest, TellsTwoSpheresAndALoneVertexApart) {
  const TriangleMesh sphere = UnitSphere(1);
  const VertexIndex n = sphere.num_vertices();
  TriangleMesh two;
  two.positions.resize(2 * n + 1, 3);
  two.positions << sphere.positions, sphere.positions,
      Eigen::RowVector3d(9, 9, 9);
  two.faces.resize(2 * sphere.num_faces(), 3);
  two.faces << sphere.faces, (sphere.faces.array() + n).matrix();
  const Components components = ConnectedComponents(two);
  EXPECT_EQ(components.count, 3);
  for (VertexIndex v = 0; v < n; ++v) {
    EXPECT_EQ(components.of_vertex[v], 0);
    EXPECT_EQ(components.of_vertex[n + v], 1);
  }
  EXPECT_EQ(components.of_vertex[2 * n], 2);
}

std::vector<VertexIndex> NonManifoldVertices(const TriangleMesh& mesh) {
  return NonManifoldVertices(mesh, EdgeFaces(mesh.faces));
}

TEST(NonManifoldVerticesTest, FacesThatShareANonManifoldEdgeAreOneFan) {
  // Three faces at the edge 0-1, and a fourth at vertex 0 alone.
  TriangleMesh book;
  book.positions = Positions::Random(7, 3);
  book.faces.resize(3, 3);
  book.faces << 0, 1, 2, 0, 1, 3, 1, 0, 4;
  EXPECT_TRUE(NonManifoldVertices(book).empty());
  book.faces.conservativeResize(4, 3);
  book.faces.row(3) << 0, 5, 6;
  EXPECT_EQ(NonManifoldVertices(book), std::vector<VertexIndex>{0});
}

TEST(NonManifoldVerticesTest, TwoFansThatTouchInAPointAreOne) {
  EXPECT_TRUE(NonManifoldVertices(UnitSphere(1)).empty());
  EXPECT_TRUE(NonManifoldVertices(PlaneGrid(3, 3, 1, 1)).empty());
  TriangleMesh bow_tie;
  bow_tie.positions = Positions::Random(5, 3);
  bow_tie.faces.resize(2, 3);
  bow_tie.faces << 0, 1, 2, 0, 3, 4;
  EXPECT_EQ(NonManifoldVertices(bow_tie), std::vector<VertexIndex>{0});
}

}  // namespace
}  // namespace isomatch
