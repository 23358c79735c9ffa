#include "core/mesh/vertex_stars.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "core/mesh/connected_ball.h"
#include "tests/support/extreme_meshes.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

TEST(VertexStarsTest, FacesAndNeighborsAreThoseOfTheMesh) {
  const TriangleMesh mesh = BumpySphere(2);
  const VertexStars stars(mesh);
  std::size_t corners = 0;
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    for (const VertexIndex f : stars.Faces(v)) {
      EXPECT_TRUE((mesh.faces.row(f).array() == v).any());
    }
    corners += stars.Faces(v).size();
    EXPECT_EQ(stars.Neighbors(v).size(), stars.Faces(v).size());  // closed
    EXPECT_EQ(stars.SomeFaces(v), stars.Faces(v));
    EXPECT_EQ(stars.SomeNeighbors(v), stars.Neighbors(v));
  }
  EXPECT_EQ(corners, static_cast<std::size_t>(mesh.faces.size()));
}

TEST(VertexStarsTest, OfAFanOnlySomeFacesAreLookedAt) {
  const VertexStars stars(Fan(3000));
  EXPECT_EQ(stars.Faces(0).size(), 3000u);
  const auto some = stars.SomeFaces(0);
  EXPECT_EQ(some.size(), VertexStars::kSome);
  EXPECT_TRUE(std::ranges::is_sorted(some));
  EXPECT_EQ(some.front(), 0);
  EXPECT_GT(some.back(), 2980);
  EXPECT_EQ(stars.SomeNeighbors(0).size(), VertexStars::kSome);
  EXPECT_EQ(stars.SomeFaces(1), stars.Faces(1));
}

TEST(VertexStarsTest, ABallOfAFanHoldsAQuarterOfIt) {
  const TriangleMesh fan = Fan(8000);
  const VertexStars stars(fan);
  const Eigen::Matrix4Xf positions = BallPositions(fan.positions);
  ConnectedBall ball(positions, stars);
  EXPECT_EQ(ball.Around(0, 10).size(), 2000u);
  EXPECT_EQ(ball.Around(5, 10).front().vertex, 5);
  EXPECT_EQ(ball.Around(5, 2e-3).size(), 3u);  // beside its two neighbors
}

}  // namespace
}  // namespace isomatch
