#include "core/descriptor/nearby_match.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "core/base/random_stream.h"
#include "core/mesh/connected_ball.h"
#include "core/mesh/mesh_geometry.h"
#include "core/spectral/cotan_laplacian.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

constexpr double kRadius = 0.15;

class NearbyMatchTest : public testing::Test {
 protected:
  NearbyMatchTest() : mesh_(FiveArms(4)) {
    mesh_.positions /= std::sqrt(SurfaceArea(mesh_));
    normals_ = VertexNormals(mesh_);
    areas_ = BuildCotanLaplacian(mesh_).mass;
    stars_ = VertexStars(mesh_);
  }

  DescribedSurface surface() const { return {mesh_, normals_, areas_, stars_}; }

  ShapeDescriptors Describe(std::int64_t count) const {
    return *DescribeShape(surface(), count, {kRadius}, {});
  }

  VertexMap Match(const ShapeDescriptors& described, const VertexMap& map,
                  const NearbyMatchOptions& options) const {
    return *MatchNearby(*PairDescriptors(described, {described, surface()}, {}),
                        map, options, {});
  }

  /// Sends every vertex to one at random that is nearer than `reach`.
  VertexMap Scattered(double reach) const {
    RandomStream random(1, 1);
    const Eigen::Matrix4Xf positions = BallPositions(mesh_.positions);
    ConnectedBall ball(positions, stars_);
    VertexMap map;
    for (VertexIndex v = 0; v < mesh_.num_vertices(); ++v) {
      const auto& near = ball.Around(v, reach);
      map.push_back(near[random.Below(static_cast<int>(near.size()))].vertex);
    }
    return map;
  }

  TriangleMesh mesh_;
  Positions normals_;
  Eigen::VectorXd areas_;
  VertexStars stars_;
};

TEST_F(NearbyMatchTest, FindsTheWayBackToTheSamePlace) {
  const ShapeDescriptors all = Describe(mesh_.num_vertices());
  // Far less than the reach, so that the surface leads back inside the ball.
  const VertexMap found = Match(all, Scattered(0.1), {.reach = 0.2});
  int right = 0;
  for (VertexIndex v = 0; v < mesh_.num_vertices(); ++v) right += found[v] == v;
  EXPECT_GT(right, 0.97 * mesh_.num_vertices());
}

TEST_F(NearbyMatchTest, NothingInReachIsMoreAlike) {
  const ShapeDescriptors described = Describe(2000);
  const VertexMap scattered = Scattered(0.1);
  const NearbyMatchOptions options = {.every = 2};
  const VertexMap found = Match(described, scattered, options);
  const Eigen::Matrix4Xf positions = BallPositions(mesh_.positions);
  ConnectedBall ball(positions, stars_);
  for (std::size_t i = 0; i < described.vertices.size(); i += 2) {
    const VertexIndex x = described.vertices[i];
    const auto unlike = [&](VertexIndex v) {
      const double away =
          (positions.col(v) - positions.col(scattered[x])).norm() /
          options.reach;
      return options.distance_weight * away * away +
             (described.columns.col(static_cast<Eigen::Index>(i)) -
              described.columns.col(described.column_of_vertex[v]))
                 .squaredNorm();
    };
    double least = std::numeric_limits<double>::infinity();
    for (const auto& [v, distance] : ball.Around(scattered[x], options.reach)) {
      if (described.column_of_vertex[v] < 0) continue;
      least = std::min(least, unlike(v));
    }
    ASSERT_NE(found[x], kNoVertex);
    EXPECT_LE(unlike(found[x]), least + 1e-6) << x;
    // Where edges lead that go not much farther.
    const auto& near = ball.Around(scattered[x], 1.5 * options.reach);
    EXPECT_TRUE(std::ranges::any_of(
        near, [&](const auto& member) { return member.vertex == found[x]; }));
    if (i + 1 < described.vertices.size()) {
      EXPECT_EQ(found[described.vertices[i + 1]], kNoVertex);
    }
  }
}

TEST_F(NearbyMatchTest, InFewDimensionsNothingIsFartherApart) {
  const ShapeDescriptors some = Describe(500);
  const DescribedPair pair = *PairDescriptors(some, {some, surface()}, {});
  double sum = 0;
  double few_sum = 0;
  for (Eigen::Index i = 0; i < some.columns.cols(); ++i) {
    for (Eigen::Index j = 0; j < i; ++j) {
      const double whole =
          (some.columns.col(i) - some.columns.col(j)).squaredNorm();
      const double few = (pair.few_x.col(i) - pair.few_y.col(j)).squaredNorm();
      EXPECT_LE(few, whole + 1e-5);
      sum += whole;
      few_sum += few;
    }
  }
  EXPECT_GT(few_sum, 0.7 * sum);
}

TEST_F(NearbyMatchTest, NeverLeavesTheReach) {
  const ShapeDescriptors all = Describe(mesh_.num_vertices());
  VertexMap far;
  for (VertexIndex v = 0; v < mesh_.num_vertices(); ++v) {
    far.push_back((v + mesh_.num_vertices() / 2) % mesh_.num_vertices());
  }
  const VertexMap found = Match(all, far, {.reach = 0.1});
  for (VertexIndex v = 0; v < mesh_.num_vertices(); ++v) {
    EXPECT_LT(
        (mesh_.positions.row(found[v]) - mesh_.positions.row(far[v])).norm(),
        0.1);
  }
}

TEST_F(NearbyMatchTest, DescribesVerticesEvenlyByArea) {
  const ShapeDescriptors some = Describe(200);
  EXPECT_LE(some.vertices.size(), 200u);
  EXPECT_GT(some.vertices.size(), 150u);
  ASSERT_EQ(some.columns.cols(), Eigen::Index(some.vertices.size()));
  // Each half of the shape gets what its area is worth.
  double area = 0;
  int described = 0;
  for (VertexIndex v = 0; v < mesh_.num_vertices(); ++v) {
    if (mesh_.positions(v, 0) > 0) area += areas_[v];
    const int column = some.column_of_vertex[v];
    if (column >= 0) {
      EXPECT_EQ(some.vertices[column], v);
    }
    described += column >= 0 && mesh_.positions(v, 0) > 0;
  }
  EXPECT_NEAR(described / double(some.vertices.size()), area / areas_.sum(),
              0.1);
}

TEST_F(NearbyMatchTest, MatchesOnlyWhatIsDescribed) {
  const ShapeDescriptors some = Describe(200);
  const VertexMap found = Match(some, Scattered(0.1), {.reach = 0.15});
  for (VertexIndex v = 0; v < mesh_.num_vertices(); ++v) {
    if (some.column_of_vertex[v] < 0) {
      EXPECT_EQ(found[v], kNoVertex);
    } else if (found[v] != kNoVertex) {
      EXPECT_GE(some.column_of_vertex[found[v]], 0);
    }
  }
}

TEST_F(NearbyMatchTest, TheMismatchOfARightMapIsNothing) {
  const ShapeDescriptors all = Describe(mesh_.num_vertices());
  const VertexMap identity = Scattered(1e-9);
  EXPECT_LT(*DescriptorMismatch(all, surface(), identity, {kRadius}, {}), 1e-6);
  const double near =
      *DescriptorMismatch(all, surface(), Scattered(0.1), {kRadius}, {});
  const double far =
      *DescriptorMismatch(all, surface(), Scattered(10), {kRadius}, {});
  EXPECT_GT(near, 0.05);
  EXPECT_GT(far, near);
  EXPECT_LE(far, 2);
}

}  // namespace
}  // namespace isomatch
