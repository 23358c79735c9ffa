#include "core/evaluation/overlap_iou.h"

#include <numeric>
#include <optional>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/mesh/mesh_geometry.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::DoubleNear;
using testing::Optional;

constexpr VertexIndex kNone = kNoVertex;

TEST(VertexAreasTest, SumUpToTheSurfaceAndAreEvenOnASphere) {
  const TriangleMesh sphere = UnitSphere(4);
  const std::vector<double> areas = VertexAreas(sphere);
  const double area = SurfaceArea(sphere);
  EXPECT_NEAR(std::accumulate(areas.begin(), areas.end(), 0.0), area,
              1e-9 * area);
  const double mean = area / sphere.num_vertices();
  for (const double of_vertex : areas) EXPECT_NEAR(of_vertex, mean, mean / 2);
}

TEST(VertexAreasTest, AVertexOnNoFaceHasNone) {
  TriangleMesh mesh = UnitSphere(1);
  mesh.positions.conservativeResize(mesh.num_vertices() + 1, 3);
  mesh.positions.bottomRows(1).setZero();
  EXPECT_EQ(VertexAreas(mesh).back(), 0);
}

TEST(OverlapIouTest, WeighsWhatIsInBothByWhatIsInEither) {
  const std::vector<double> weights = {1, 2, 4, 8, 16};
  // M has 0, 1, 2, T has 1, 2, 3.
  EXPECT_THAT(
      OverlapIou({5, 5, 5, kNone, kNone}, {kNone, 0, 1, 2, kNone}, {}, weights),
      Optional(DoubleNear(6.0 / 15, 1e-15)));
}

TEST(OverlapIouTest, WhatTheTruthDoesNotNameCountsInNeither) {
  const VertexMap found = {5, 5, kNone, kNone};
  const VertexMap truth = {0, kNone, 1, kNone};
  const std::vector<double> weights = {1, 2, 4, 8};
  EXPECT_THAT(OverlapIou(found, truth, {}, weights),
              Optional(DoubleNear(1.0 / 7, 1e-15)));
  EXPECT_THAT(OverlapIou(found, truth, {true, false, true, true}, weights),
              Optional(DoubleNear(1.0 / 5, 1e-15)));
  EXPECT_EQ(OverlapIou(found, truth, {true, false, false, false}, weights),
            std::nullopt);
}

TEST(OverlapIouTest, WholeMapsHaveNone) {
  const VertexMap whole = {2, 1, 0};
  EXPECT_EQ(OverlapIou(whole, whole, {}, {1, 1, 1}), std::nullopt);
  // A vertex on no face covers nothing.
  EXPECT_EQ(OverlapIou({2, kNone, 0}, whole, {}, {1, 0, 1}), std::nullopt);
}

TEST(OverlapIouTest, NothingInCommonIsNoneAndTwoEmptyPartsAreOne) {
  EXPECT_THAT(OverlapIou({1, kNone}, {kNone, 1}, {}, {1, 1}), Optional(0.0));
  EXPECT_THAT(OverlapIou({kNone, kNone}, {kNone, kNone}, {}, {1, 1}),
              Optional(1.0));
}

}  // namespace
}  // namespace isomatch
