#include "server/engine/result_parts.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace isomatch {
namespace {

using testing::ElementsAre;

// 0.5 and 0.25 as float32, 2 and -1 as float64, little-endian.
const std::string kHalf("\0\0\0\x3F", 4);
const std::string kQuarter("\0\0\x80\x3E", 4);
const std::string kTwo("\0\0\0\0\0\0\0\x40", 8);
const std::string kMinusOne("\0\0\0\0\0\0\xF0\xBF", 8);
const std::string kZero(8, '\0');

std::vector<ResultPart> Kinds(const std::vector<EncodedPart>& parts) {
  std::vector<ResultPart> kinds;
  kinds.reserve(parts.size());
  for (const EncodedPart& part : parts) kinds.push_back(part.part);
  return kinds;
}

TEST(ResultPartsTest, WhatTheMethodLeftEmptyIsNoPart) {
  Correspondence found;
  found.y_from_x = {0};
  EXPECT_THAT(Kinds(EncodeParts(found)), ElementsAre(ResultPart::kMap));
  found.alternatives.push_back({{0}, {}});
  EXPECT_THAT(Kinds(EncodeParts(found)),
              ElementsAre(ResultPart::kMap, ResultPart::kAlternativeMap));
}

TEST(ResultPartsTest, MapsAreUint32AndNoMatchIsAllOnes) {
  Correspondence found;
  found.y_from_x = {0x01020304, kNoVertex};
  found.alternatives = {{{5}, {}}, {{6}, {}}};
  const std::vector<EncodedPart> parts = EncodeParts(found);
  EXPECT_EQ(parts[0].bytes, "\4\3\2\1\xFF\xFF\xFF\xFF");
  EXPECT_EQ(parts[1].bytes, std::string("\5\0\0\0", 4));  // of the best
}

TEST(ResultPartsTest, APreciseMapHasThreeVerticesAndTheirWeights) {
  Correspondence found;
  found.precise = {{{7, 8, 9}, {0.5, 0.25, 0.25}}, {}};
  const std::vector<EncodedPart> parts = EncodeParts(found);
  ASSERT_EQ(parts[1].part, ResultPart::kPreciseMap);
  EXPECT_EQ(parts[1].bytes,
            std::string("\7\0\0\0\x8\0\0\0\x9\0\0\0", 12) + kHalf + kQuarter +
                kQuarter + std::string(12, '\xFF') + std::string(12, '\0'));
}

TEST(ResultPartsTest, ConfidenceIsFloat32) {
  Correspondence found;
  found.confidence = {0.25f, 0.5f};
  const std::vector<EncodedPart> parts = EncodeParts(found);
  ASSERT_EQ(parts[1].part, ResultPart::kConfidence);
  EXPECT_EQ(parts[1].bytes, kQuarter + kHalf);
}

TEST(ResultPartsTest, AFunctionalMapIsStoredByRows) {
  Correspondence found;
  found.functional_map.resize(2, 2);
  found.functional_map << 0, 2, -1, 0;
  found.eigenvalues_x = Eigen::Vector2d(0, -1);
  found.eigenvalues_y = Eigen::Vector2d(0, 2);
  const std::vector<EncodedPart> parts = EncodeParts(found);
  ASSERT_EQ(parts[1].part, ResultPart::kFunctionalMap);
  EXPECT_EQ(parts[1].bytes, std::string("\2\0\0\0", 4) + kZero + kMinusOne +
                                kZero + kTwo + kZero + kTwo + kMinusOne +
                                kZero);
}

TEST(ResultPartsTest, AMaskIsAByteForEachVertexOfY) {
  Correspondence found;
  found.matched_y = {1, 0, 1};
  const std::vector<EncodedPart> parts = EncodeParts(found);
  ASSERT_EQ(parts[1].part, ResultPart::kMaskY);
  EXPECT_EQ(parts[1].bytes, std::string("\1\0\1", 3));
  EXPECT_STREQ(ResultPartName(parts[1].part), "MASK_Y");
}

}  // namespace
}  // namespace isomatch
