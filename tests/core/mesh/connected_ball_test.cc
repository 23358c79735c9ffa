#include "core/mesh/connected_ball.h"

#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/dirty_meshes.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

std::vector<VertexIndex> Sorted(
    const std::vector<ConnectedBall::Member>& members) {
  std::vector<VertexIndex> vertices;
  for (const auto& member : members) vertices.push_back(member.vertex);
  std::sort(vertices.begin(), vertices.end());
  return vertices;
}

TEST(ConnectedBallTest, OnAPlaneHoldsAllThatIsNear) {
  const TriangleMesh mesh = PlaneGrid(20, 20, 1, 1);
  const VertexStars stars(mesh);
  const Eigen::Matrix4Xf positions = BallPositions(mesh.positions);
  ConnectedBall ball(positions, stars);
  for (const VertexIndex center : {0, 220, 440, 220}) {
    std::vector<VertexIndex> near;
    for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
      if ((mesh.positions.row(v) - mesh.positions.row(center)).norm() < 0.23) {
        near.push_back(v);
      }
    }
    const auto& members = ball.Around(center, 0.23);
    EXPECT_EQ(members.front().vertex, center);
    EXPECT_EQ(members.front().distance, 0);
    EXPECT_EQ(Sorted(members), near);
    for (const auto& [v, distance] : members) {
      EXPECT_NEAR(distance,
                  (mesh.positions.row(v) - mesh.positions.row(center)).norm(),
                  1e-6);
    }
  }
}

TEST(ConnectedBallTest, WhatWasAskedLastIsNotTakenForSomethingElse) {
  const TriangleMesh mesh = PlaneGrid(20, 20, 1, 1);
  const VertexStars stars(mesh);
  const Eigen::Matrix4Xf positions = BallPositions(mesh.positions);
  ConnectedBall ball(positions, stars);
  const auto count = [&](VertexIndex center, double radius) {
    return ball.Around(center, radius).size();
  };
  const std::size_t small = count(220, 0.1);
  const std::size_t large = count(220, 0.2);
  EXPECT_GT(large, 3 * small);
  EXPECT_EQ(count(220, 0.2), large);
  EXPECT_EQ(count(220, 0.1), small);
  EXPECT_LT(count(0, 0.1), small);
  EXPECT_EQ(count(220, 0.1), small);
}

TEST(ConnectedBallTest, LeavesOutASheetThatOnlyLiesNear) {
  const TriangleMesh sheet = PlaneGrid(10, 10, 1, 1);
  TriangleMesh raised = sheet;
  raised.positions.col(2).array() += 0.01;
  const TriangleMesh two =
      Joined(Untouched(sheet), Untouched(raised), sheet.num_vertices()).mesh;
  const VertexStars stars(two);
  const Eigen::Matrix4Xf positions = BallPositions(two.positions);
  ConnectedBall ball(positions, stars);
  for (const auto& member : ball.Around(60, 0.3)) {
    EXPECT_LT(member.vertex, sheet.num_vertices());
  }
  EXPECT_GT(ball.Around(60, 0.3).size(), 20u);
}

}  // namespace
}  // namespace isomatch
