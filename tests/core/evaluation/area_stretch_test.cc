#include "core/evaluation/area_stretch.h"

#include <cmath>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/LU>

#include "core/mesh/vertex_stars.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::Each;
using testing::FloatNear;

TEST(AreaStretchTest, AnIsometryStretchesNothingAtAnyScale) {
  const TriangleMesh x = BumpySphere(3);
  for (const double scale : {1e-8, 1.0, 1e8}) {
    EXPECT_THAT(
        LogAreaStretch(x, Moved(x, scale), IdentityMap(x.num_vertices())),
        Each(FloatNear(0, 1e-5)));
  }
}

TEST(AreaStretchTest, FollowsTheNumbersOfVertices) {
  const TriangleMesh x = BumpySphere(2);
  const VertexMap y_from_x = RandomPermutation(x.num_vertices(), 1);
  EXPECT_THAT(LogAreaStretch(x, Relabeled(x, y_from_x), y_from_x),
              Each(FloatNear(0, 1e-5)));
}

// Rounding to vertices would make every image but the corners' wrong.
TEST(AreaStretchTest, ImagesBetweenVerticesStretchNothing) {
  const TriangleMesh x = PlaneGrid(7, 7, 1, 1);
  const TriangleMesh y = PlaneGrid(1, 1, 1, 1);
  std::vector<SurfacePoint> images;
  for (VertexIndex v = 0; v < x.num_vertices(); ++v) {
    for (VertexIndex f = 0; f < y.num_faces(); ++f) {
      Eigen::Matrix3d corners;
      for (int i = 0; i < 3; ++i) {
        corners.col(i) = y.positions.row(y.faces(f, i)).transpose();
      }
      corners.row(2).setOnes();
      const Eigen::Vector3d weights =
          corners.inverse() *
          Eigen::Vector3d(x.positions(v, 0), x.positions(v, 1), 1);
      if (weights.minCoeff() < -1e-9) continue;
      images.push_back({f, weights});
      break;
    }
  }
  ASSERT_EQ(static_cast<VertexIndex>(images.size()), x.num_vertices());
  EXPECT_THAT(LogAreaStretch(x, y, images), Each(FloatNear(0, 1e-5)));
}

// The left half keeps its area, the right one has three times as much, so that
// the whole is doubled.
TEST(AreaStretchTest, MeasuresAStretchedHalf) {
  const TriangleMesh x = PlaneGrid(40, 10, 4, 1);
  TriangleMesh y = x;
  for (VertexIndex v = 0; v < y.num_vertices(); ++v) {
    const double from_middle = x.positions(v, 0) - 2;
    if (from_middle > 0) y.positions(v, 0) = 2 + 3 * from_middle;
  }
  const std::vector<float> stretch =
      LogAreaStretch(x, y, IdentityMap(x.num_vertices()));
  for (VertexIndex v = 0; v < x.num_vertices(); ++v) {
    const double from_middle = x.positions(v, 0) - 2;
    if (std::abs(from_middle) < 1) continue;
    EXPECT_NEAR(stretch[v], std::log(from_middle > 0 ? 1.5 : 0.5), 1e-5) << v;
  }
}

// On a coarser mesh most faces have images without area; taken together they
// still cover it.
TEST(AreaStretchTest, ACoarserMeshIsNoCollapse) {
  const TriangleMesh x = PlaneGrid(48, 48, 1, 1);
  const TriangleMesh y = PlaneGrid(12, 12, 1, 1);
  VertexMap y_from_x;
  for (VertexIndex v = 0; v < x.num_vertices(); ++v) {
    const auto column = static_cast<int>(std::lround(x.positions(v, 0) * 12));
    const auto row = static_cast<int>(std::lround(x.positions(v, 1) * 12));
    y_from_x.push_back(row * 13 + column);
  }
  const std::vector<float> stretch = LogAreaStretch(x, y, y_from_x);
  EXPECT_THAT(stretch, Each(FloatNear(0, 0.5)));
}

// A vertex for each neighbor's: rounding folds faces over, which must not
// count as area.
TEST(AreaStretchTest, RoundingIsNoStretch) {
  const TriangleMesh x = UnitSphere(5);
  const VertexStars stars(x);
  const std::vector<VertexIndex> shuffled =
      RandomPermutation(x.num_vertices(), 2);
  VertexMap y_from_x;
  for (VertexIndex v = 0; v < x.num_vertices(); ++v) {
    const auto neighbors = stars.Neighbors(v);
    y_from_x.push_back(neighbors[shuffled[v] % neighbors.size()]);
  }
  double sum = 0;
  for (const float stretch : LogAreaStretch(x, x, y_from_x)) sum += stretch;
  EXPECT_NEAR(sum / x.num_vertices(), 0, 0.2);
}

TEST(AreaStretchTest, AMirrorImageIsNotStretched) {
  const TriangleMesh x = BumpySphere(3);
  TriangleMesh y = x;
  y.positions.col(0) *= -1;
  y.faces.col(0).swap(y.faces.col(1));
  EXPECT_THAT(LogAreaStretch(x, y, IdentityMap(x.num_vertices())),
              Each(FloatNear(0, 1e-5)));
}

// Faces of a file need not agree in orientation.
TEST(AreaStretchTest, FlippedFacesDoNotMatter) {
  const TriangleMesh x = BumpySphere(3);
  TriangleMesh y = x;
  for (VertexIndex f = 0; f < y.num_faces(); f += 3) {
    std::swap(y.faces(f, 0), y.faces(f, 1));
  }
  EXPECT_THAT(LogAreaStretch(y, x, IdentityMap(x.num_vertices())),
              Each(FloatNear(0, 1e-5)));
  EXPECT_THAT(LogAreaStretch(x, y, IdentityMap(x.num_vertices())),
              Each(FloatNear(0, 1e-5)));
}

TEST(AreaStretchTest, WithoutAMatchThereIsNoValue) {
  const TriangleMesh x = PlaneGrid(10, 10, 1, 1);
  VertexMap y_from_x = IdentityMap(x.num_vertices());
  y_from_x[60] = kNoVertex;
  const std::vector<float> stretch = LogAreaStretch(x, x, y_from_x);
  EXPECT_TRUE(std::isnan(stretch[60]));
  EXPECT_NEAR(stretch[61], 0, 1e-5);
  EXPECT_THAT(LogAreaStretch(x, x, VertexMap(x.num_vertices(), kNoVertex)),
              Each(testing::IsNan()));
}

}  // namespace
}  // namespace isomatch
