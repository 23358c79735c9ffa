#include "client/viewer/layers.h"

#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::Each;
using testing::FloatNear;
using testing::IsNan;

class LayersTest : public testing::Test {
 protected:
  LayersTest() { std::iota(identity_.begin(), identity_.end(), 0); }

  const TriangleMesh mesh_ = BumpySphere(2);
  VertexMap identity_ = VertexMap(mesh_.num_vertices());
  const MappedPair pair_ = {mesh_, mesh_, identity_};
};

TEST_F(LayersTest, ConfidenceKeepsItsNumbersOnBothShapes) {
  std::vector<float> confidence(mesh_.num_vertices());
  for (std::size_t v = 0; v < confidence.size(); ++v) {
    confidence[v] = 1.0F / static_cast<float>(v + 1);
  }
  const ScalarLayer layer = ConfidenceLayer(pair_, confidence);
  EXPECT_EQ(layer.on_x, confidence);
  EXPECT_EQ(layer.on_y, confidence);
  EXPECT_EQ(layer.low, 0);
  EXPECT_EQ(layer.high, 1);
}

TEST_F(LayersTest, WhatHasNoCounterpartHasNoNumberInAnyLayer) {
  VertexMap map = identity_;
  std::vector<std::uint8_t> matched(map.size(), 1);
  for (std::size_t v = 0; v < map.size(); v += 2) {
    map[v] = kNoVertex;
    matched[v] = 0;
  }
  GeodesicError error;
  error.of_vertex.assign(map.size(), 0.5F);
  for (std::size_t v = 0; v < map.size(); v += 2) error.of_vertex[v] = -1;
  const MappedPair pair = {mesh_, mesh_, map, {}, matched};
  const std::vector<float> confidence(map.size(), 0.5F);
  for (const ScalarLayer& layer :
       {ConfidenceLayer(pair, confidence), ErrorLayer(pair, error),
        DistortionLayer(pair)}) {
    for (std::size_t v = 0; v < map.size(); v += 2) {
      ASSERT_THAT(layer.on_x[v], IsNan()) << layer.id;
      ASSERT_THAT(layer.on_y[v], IsNan()) << layer.id;
    }
  }
  const ScalarLayer layer = ConfidenceLayer(pair, confidence);
  EXPECT_EQ(layer.on_x[1], 0.5F);
  EXPECT_EQ(layer.on_y[1], 0.5F);
}

TEST_F(LayersTest, ErrorsKeepTheirNumbersAndTheScaleHoldsMostOfThem) {
  GeodesicError error;
  error.of_vertex.assign(mesh_.num_vertices(), 0.03F);
  error.of_vertex[0] = 0.9F;
  error.of_vertex[1] = -1;
  const ScalarLayer layer = ErrorLayer(pair_, error);
  EXPECT_FLOAT_EQ(layer.on_x[0], 0.9F);
  EXPECT_THAT(layer.on_x[1], IsNan());
  EXPECT_FLOAT_EQ(layer.on_y[2], 0.03F);
  EXPECT_DOUBLE_EQ(layer.high, 0.05);
}

TEST_F(LayersTest, SmallErrorsDoNotFillTheScale) {
  GeodesicError error;
  error.of_vertex.assign(mesh_.num_vertices(), 0.0001F);
  EXPECT_DOUBLE_EQ(ErrorLayer(pair_, error).high, 0.01);
  error.of_vertex.assign(mesh_.num_vertices(), -1);
  EXPECT_DOUBLE_EQ(ErrorLayer(pair_, error).high, 0.01);
}

TEST_F(LayersTest, NothingIsDistortedByTheIdentity) {
  const ScalarLayer layer = DistortionLayer(pair_);
  EXPECT_THAT(layer.on_x, Each(FloatNear(0, 1e-5)));
  EXPECT_THAT(layer.on_y, Each(FloatNear(0, 1e-5)));
}

}  // namespace
}  // namespace isomatch
