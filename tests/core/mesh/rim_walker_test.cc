#include "core/mesh/rim_walker.h"

#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::SizeIs;

/// All rims of a mesh that are closed, or all that are not.
std::vector<std::vector<VertexIndex>> Rims(const TriangleMesh& mesh,
                                           bool is_closed) {
  const EdgeFaces edges(mesh.faces);
  RimWalker walker(edges, mesh.faces);
  std::vector<std::vector<VertexIndex>> rims;
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    for (int corner = 0; corner < 3; ++corner) {
      const auto rim = walker.Walk({f, corner});
      if (rim.empty() || walker.is_closed() != is_closed) continue;
      rims.emplace_back(rim.begin(), rim.end());
    }
  }
  return rims;
}

TEST(RimWalkerTest, AClosedSurfaceHasNone) {
  EXPECT_THAT(Rims(Tetrahedron(), true), SizeIs(0));
  EXPECT_THAT(Rims(Tetrahedron(), false), SizeIs(0));
}

TEST(RimWalkerTest, GoesAroundInTurnOnce) {
  TriangleMesh mesh = Tetrahedron();
  mesh.faces = mesh.faces.topRows(3).eval();
  const auto rims = Rims(mesh, true);
  ASSERT_THAT(rims, SizeIs(1));
  EXPECT_THAT(rims[0], SizeIs(3));
  // Each edge runs as in its face.
  for (std::size_t i = 0; i < 3; ++i) {
    int found = 0;
    for (VertexIndex f = 0; f < 3; ++f) {
      for (int corner = 0; corner < 3; ++corner) {
        found += mesh.faces(f, corner) == rims[0][i] &&
                 mesh.faces(f, (corner + 1) % 3) == rims[0][(i + 1) % 3];
      }
    }
    EXPECT_EQ(found, 1);
  }
}

TEST(RimWalkerTest, RimsThatTouchAreApart) {
  TriangleMesh mesh;
  mesh.positions = Positions::Random(5, 3);
  mesh.faces.resize(2, 3);
  mesh.faces << 0, 1, 2, 0, 3, 4;
  EXPECT_THAT(Rims(mesh, true),
              ElementsAre(ElementsAre(0, 1, 2), ElementsAre(0, 3, 4)));
}

TEST(RimWalkerTest, ARimThatMeetsANonManifoldEdgeIsNotClosed) {
  TriangleMesh mesh;
  mesh.positions = Positions::Random(5, 3);
  mesh.faces.resize(3, 3);
  mesh.faces << 0, 1, 2, 1, 0, 3, 0, 1, 4;
  EXPECT_THAT(Rims(mesh, true), SizeIs(0));
  EXPECT_THAT(
      Rims(mesh, false),
      ElementsAre(ElementsAre(1, 2), ElementsAre(0, 3), ElementsAre(1, 4)));
}

}  // namespace
}  // namespace isomatch
