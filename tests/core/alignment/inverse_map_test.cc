#include "core/alignment/inverse_map.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/mesh/mesh_geometry.h"
#include "core/spectral/cotan_laplacian.h"
#include "tests/support/dirty_meshes.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

/// A part of a sphere, laid where it belongs.
class InverseMapTest : public testing::Test {
 protected:
  InverseMapTest()
      : sphere_(UnitSphere(4)),
        cap_(WithoutLoneVertices(
            WithoutFaces(Untouched(sphere_), Beyond({0, 0, -1}, 0.2)))),
        stars_(sphere_),
        normals_(VertexNormals(sphere_)),
        areas_(BuildCotanLaplacian(sphere_).mass),
        areas_cap_(BuildCotanLaplacian(cap_.mesh).mass),
        in_cap_(sphere_.num_vertices(), false) {
    for (const VertexIndex v : cap_.origin) in_cap_[v] = true;
  }

  InverseMap Invert(const Positions& places,
                    const std::vector<char>& matched = {}) {
    return *InvertMap({cap_.mesh, areas_cap_, places, matched},
                      {sphere_, stars_, areas_, normals_}, {});
  }

  const TriangleMesh sphere_;
  const DirtyMesh cap_;
  const VertexStars stars_;
  const Positions normals_;
  const Eigen::VectorXd areas_;
  const Eigen::VectorXd areas_cap_;
  std::vector<char> in_cap_;
};

TEST_F(InverseMapTest, VerticesUnderThePartHaveItsPointsAndNoOthers) {
  const InverseMap inverse = Invert(cap_.mesh.positions);
  EXPECT_EQ(inverse.covered, in_cap_);
  for (VertexIndex v = 0; v < sphere_.num_vertices(); ++v) {
    if (!in_cap_[v]) continue;
    EXPECT_LT(
        (PositionOf(cap_.mesh, inverse.points[v]) - sphere_.positions.row(v))
            .norm(),
        1e-9);
  }
}

TEST_F(InverseMapTest, WhatIsNotMatchedCoversNothing) {
  std::vector<char> matched(cap_.mesh.num_vertices());
  for (VertexIndex v = 0; v < cap_.mesh.num_vertices(); ++v) {
    matched[v] = cap_.mesh.positions(v, 0) > 0;
  }
  const InverseMap inverse = Invert(cap_.mesh.positions, matched);
  for (VertexIndex v = 0; v < sphere_.num_vertices(); ++v) {
    // Beside the border faces count that have all corners matched.
    if (std::abs(sphere_.positions(v, 0)) < 0.1) continue;
    EXPECT_EQ(inverse.covered[v] != 0,
              in_cap_[v] && sphere_.positions(v, 0) > 0);
  }
}

TEST_F(InverseMapTest, WhatFacesTheOtherWayOrLiesFarAwayCoversNothing) {
  // Turned inside out: normals point inward.
  const InverseMap inside_out =
      *InvertMap({{cap_.mesh.positions, cap_.mesh.faces.rowwise().reverse()},
                  areas_cap_,
                  cap_.mesh.positions,
                  {}},
                 {sphere_, stars_, areas_, normals_}, {});
  const InverseMap away = Invert(1.5 * cap_.mesh.positions);
  for (VertexIndex v = 0; v < sphere_.num_vertices(); ++v) {
    EXPECT_FALSE(inside_out.covered[v]);
    EXPECT_FALSE(away.covered[v]);
  }
}

}  // namespace
}  // namespace isomatch
