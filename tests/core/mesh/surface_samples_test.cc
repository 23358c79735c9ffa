#include "core/mesh/surface_samples.h"

#include <algorithm>
#include <limits>
#include <utility>

#include <gtest/gtest.h>

#include "tests/support/dirty_meshes.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

/// A shape with its positions as points.
struct Placed {
  explicit Placed(TriangleMesh shape)
      : mesh(std::move(shape)),
        stars(mesh),
        areas(Eigen::VectorXd::Ones(mesh.num_vertices())),
        columns(mesh.positions.transpose().cast<float>()) {}
  PointsOnSurface points() const { return {stars, areas, columns}; }

  TriangleMesh mesh;
  VertexStars stars;
  Eigen::VectorXd areas;
  PointColumns columns;
};

TEST(SurfaceSamplesTest, AFewAreSpreadByArea) {
  Eigen::VectorXd areas = Eigen::VectorXd::Ones(1000);
  areas.head(500) *= 3;
  const std::vector<VertexIndex> chosen = EvenlyByArea(areas, 200);
  EXPECT_EQ(chosen.size(), 200u);
  EXPECT_TRUE(std::is_sorted(chosen.begin(), chosen.end()));
  EXPECT_EQ(std::count_if(chosen.begin(), chosen.end(),
                          [](VertexIndex v) { return v < 500; }),
            150);
}

TEST(SurfaceSamplesTest, AllAreTakenWhereFewerAreThanAskedFor) {
  const Eigen::VectorXd areas = Eigen::VectorXd::LinSpaced(50, 0.1, 9);
  const std::vector<VertexIndex> chosen = EvenlyByArea(areas, 50);
  ASSERT_EQ(chosen.size(), 50u);
  for (int v = 0; v < 50; ++v) EXPECT_EQ(chosen[v], v);
}

TEST(SurfaceSamplesTest, NoVertexHasAHomeFartherThanItsNeighborsHave) {
  const Placed arms(FiveArms(4));
  const SurfaceSamples samples = SampleSurface(arms.stars, arms.areas, 100);
  ASSERT_EQ(samples.vertices.size(), 100u);
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ(samples.home[samples.vertices[i]], i);
  }
  // A home is handed on from a neighbor that has it too.
  for (VertexIndex v = 0; v < arms.mesh.num_vertices(); ++v) {
    ASSERT_GE(samples.home[v], 0);
    if (samples.vertices[samples.home[v]] == v) continue;
    const auto around = arms.stars.Neighbors(v);
    EXPECT_TRUE(std::any_of(around.begin(), around.end(), [&](VertexIndex u) {
      return samples.home[u] == samples.home[v];
    }));
  }
}

TEST(SurfaceSamplesTest, AComponentWithoutASampleHasNoHome) {
  const TriangleMesh sphere = UnitSphere(1);
  const Placed two(
      Joined(Untouched(sphere), Untouched(sphere), sphere.num_vertices()).mesh);
  const SurfaceSamples samples = SampleSurface(two.stars, two.areas, 1);
  ASSERT_EQ(samples.vertices.size(), 1u);
  EXPECT_EQ(std::count(samples.home.begin(), samples.home.end(), -1),
            sphere.num_vertices());
}

TEST(SurfaceSamplesTest, DescentFromSamplesFindsWhatComparingAllFinds) {
  const Placed x(FiveArms(4));
  const Placed y(Relabeled(FiveArms(5), RandomPermutation(10242, 3)));
  const VertexMap all = *NearestColumns(x.columns, y.columns, {});
  const VertexMap descended =
      *NearestBySamples(x.points(), y.points(), 300, {});
  ASSERT_EQ(descended.size(), all.size());
  int same = 0;
  for (std::size_t v = 0; v < all.size(); ++v) same += all[v] == descended[v];
  EXPECT_GT(same, 0.99 * static_cast<double>(all.size()));
  // 26 million pairs are compared, 105 million are not.
  EXPECT_EQ(*NearestOnSurface(x.points(), y.points(), {}), all);
  const Placed large(FiveArms(5));
  EXPECT_EQ(*NearestOnSurface(large.points(), y.points(), {}),
            *NearestBySamples(large.points(), y.points(), 6000, {}));
}

TEST(SurfaceSamplesTest, StopsWhenAsked) {
  const Placed x(FiveArms(2));
  std::stop_source source;
  source.request_stop();
  EXPECT_THAT(
      NearestBySamples(x.points(), x.points(), 50, source.get_token()).status(),
      StatusIs(absl::StatusCode::kCancelled, testing::_));
}

TEST(SurfaceSamplesTest, DescentEndsWherePlacesAreNoNumbers) {
  Placed y(UnitSphere(2));
  Placed x(UnitSphere(2));
  const float nan = std::numeric_limits<float>::quiet_NaN();
  y.columns.col(5).setConstant(nan);
  for (const VertexIndex start : {VertexIndex{0}, VertexIndex{5}}) {
    EXPECT_NE(DescendOverEdges(x.points(), y.points(), 1, start, {}),
              kNoVertex);
  }
  x.columns.setConstant(nan);
  EXPECT_EQ(DescendOverEdges(x.points(), y.points(), 1, 3, {}), 3);
}

}  // namespace
}  // namespace isomatch
