#include "core/evaluation/geodesic_error.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::HasSubstr;

constexpr auto kInvalid = absl::StatusCode::kInvalidArgument;

TEST(GeodesicErrorTest, DiameterAndAreaOfTheSphere) {
  const GeodesicErrorMeter meter(UnitSphere(4));
  EXPECT_NEAR(meter.diameter(), std::numbers::pi, 0.05);
  EXPECT_NEAR(meter.sqrt_area(), std::sqrt(4 * std::numbers::pi), 0.01);
}

TEST(GeodesicErrorTest, TheTruthItselfHasNone) {
  const GeodesicErrorMeter meter(FiveArms(3));
  const VertexMap truth = IdentityMap(642);
  const auto error = meter.Measure(truth, truth);
  ASSERT_THAT(error, IsOk());
  EXPECT_EQ(error->evaluated, 642);
  EXPECT_EQ(error->mean_over_diameter, 0);
  EXPECT_EQ(error->max_over_diameter, 0);
  for (const double within : error->within) EXPECT_EQ(within, 1);
}

TEST(GeodesicErrorTest, AShiftInThePlaneIsItsLength) {
  constexpr int kColumns = 50;
  const GeodesicErrorMeter meter(PlaneGrid(kColumns, 50, 5, 5));
  VertexMap truth(51 * 51, kNoVertex);
  VertexMap shifted(51 * 51, kNoVertex);
  for (int row = 0; row < 50; ++row) {
    const int v = row * (kColumns + 1);
    truth[v] = v;
    shifted[v] = v + 4;  // 0.4 along x
  }
  const auto error = meter.Measure(shifted, truth);
  ASSERT_THAT(error, IsOk());
  EXPECT_EQ(error->evaluated, 50);
  const double diameter = 5 * std::numbers::sqrt2;
  EXPECT_NEAR(error->diameter, diameter, 1e-4);
  EXPECT_NEAR(error->mean_over_diameter, 0.4 / diameter, 1e-5);
  EXPECT_NEAR(error->of_vertex[0], 0.4 / diameter, 1e-5);
  EXPECT_NEAR(error->mean_over_sqrt_area, 0.4 / 5, 1e-5);
  // 0.0566 of the diameter.
  EXPECT_EQ(error->within[2], 0);
  EXPECT_EQ(error->within[3], 1);
}

// In the plane the way to a place is a straight line, wherever in its face and
// however near to the source it is.
TEST(GeodesicErrorTest, APlaceBetweenVerticesIsAsFarAsItLies) {
  const TriangleMesh mesh = PlaneGrid(20, 20, 2, 2);
  const GeodesicErrorMeter meter(mesh);
  const VertexIndex source = 10 * 21 + 10;
  std::vector<SurfacePoint> found;
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    found.push_back({f, {0.2, 0.3, 0.5}});
    found.push_back({f, {0, 0.25, 0.75}});
  }
  const VertexMap truth(found.size(), source);
  const auto error = meter.Measure(mesh.faces, found, truth);
  ASSERT_THAT(error, IsOk());
  for (std::size_t i = 0; i < found.size(); ++i) {
    const double distance =
        (PositionOf(mesh, found[i]) - mesh.positions.row(source)).norm();
    ASSERT_NEAR(error->of_vertex[i] * error->diameter, distance, 2e-3) << i;
    // Exact in the faces at the source, not the mean of their corners.
    if (distance < 0.07) {
      ASSERT_NEAR(error->of_vertex[i] * error->diameter, distance, 1e-6) << i;
    }
  }
}

TEST(GeodesicErrorTest, PlacesAtVerticesAreVertices) {
  const TriangleMesh mesh = FiveArms(3);
  const GeodesicErrorMeter meter(mesh);
  VertexMap found;
  std::vector<SurfacePoint> points;
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    found.push_back(f == 7 ? kNoVertex : mesh.faces(f, f % 3));
    points.push_back({f == 7 ? kNoVertex : f, Eigen::Vector3d::Unit(f % 3)});
  }
  const VertexMap truth(found.size(), 5);
  const auto of_vertices = meter.Measure(found, truth);
  const auto of_points = meter.Measure(mesh.faces, points, truth);
  ASSERT_THAT(of_points, IsOk());
  EXPECT_EQ(of_points->of_vertex, of_vertices->of_vertex);
  EXPECT_EQ(of_points->unmatched, 1);
}

TEST(GeodesicErrorTest, CountsTheUnmatchedApart) {
  const GeodesicErrorMeter meter(UnitSphere(1));
  VertexMap found = IdentityMap(42);
  found[7] = kNoVertex;
  VertexMap truth = IdentityMap(42);
  truth[9] = kNoVertex;
  const auto error = meter.Measure(found, truth);
  ASSERT_THAT(error, IsOk());
  EXPECT_EQ(error->evaluated, 41);
  EXPECT_EQ(error->unmatched, 1);
  EXPECT_EQ(error->mean_over_diameter, 0);
  for (int v = 0; v < 42; ++v) {
    EXPECT_EQ(error->of_vertex[v], v == 7 || v == 9 ? -1 : 0) << v;
  }
}

TEST(GeodesicErrorTest, RefusesWhatCannotBeCompared) {
  const GeodesicErrorMeter meter(UnitSphere(1));
  const VertexMap truth = IdentityMap(42);
  EXPECT_THAT(meter.Measure(IdentityMap(41), truth).status(),
              StatusIs(kInvalid, HasSubstr("the map has 41 entries")));
  VertexMap bad = truth;
  bad[5] = 42;
  EXPECT_THAT(meter.Measure(bad, truth).status(),
              StatusIs(kInvalid, HasSubstr("map[5]: 42, expected 0 to 41")));
  EXPECT_THAT(meter.Measure(truth, bad).status(),
              StatusIs(kInvalid, HasSubstr("truth[5]")));
  EXPECT_THAT(meter.Measure(truth, VertexMap(42, kNoVertex)).status(),
              StatusIs(kInvalid, HasSubstr("nothing to compare")));
}

}  // namespace
}  // namespace isomatch
