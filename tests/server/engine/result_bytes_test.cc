#include "core/io/result_bytes.h"

#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/engine/result_parts.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr PairSize kSize = {/*vertices_x=*/2, /*vertices_y=*/9};
const std::vector<char> kMask = {1, 0, 0, 1, 1, 1, 0, 1, 1};

auto Damaged(const std::string& why) {
  return StatusIs(absl::StatusCode::kDataLoss, HasSubstr(why));
}

Correspondence Found() {
  Correspondence found;
  found.y_from_x = {8, kNoVertex};
  found.precise = {{{8, 0, 5}, {0.5, 0.375, 0.125}}, {}};
  found.confidence = {0.75f, 0};
  found.alternatives.push_back({{kNoVertex, 3}, {}});
  found.functional_map.resize(2, 2);
  found.functional_map << 1, -2, 0.1, 4;
  found.eigenvalues_x = Eigen::Vector2d(0, 1e-300);
  found.eigenvalues_y = Eigen::Vector2d(0, 6);
  found.matched_y = kMask;
  return found;
}

std::string Encoded(ResultPart part) {
  for (EncodedPart& encoded : EncodeParts(Found())) {
    if (encoded.part == part) return encoded.bytes;
  }
  return "";
}

TEST(ResultBytesTest, WhatTheServerEncodesComesBack) {
  const Correspondence found = Found();
  EXPECT_EQ(*DecodeMap(Encoded(ResultPart::kMap), kSize), found.y_from_x);
  EXPECT_EQ(*DecodeMap(Encoded(ResultPart::kAlternativeMap), kSize),
            found.alternatives[0].y_from_x);
  EXPECT_EQ(*DecodeConfidence(Encoded(ResultPart::kConfidence), kSize),
            found.confidence);
  const auto points = DecodePreciseMap(Encoded(ResultPart::kPreciseMap), kSize);
  ASSERT_THAT(points, IsOk());
  ASSERT_EQ(points->size(), 2);
  EXPECT_THAT((*points)[0].vertices, ElementsAre(8, 0, 5));
  EXPECT_THAT((*points)[0].weights, ElementsAre(0.5, 0.375, 0.125));
  EXPECT_THAT((*points)[1].vertices,
              ElementsAre(kNoVertex, kNoVertex, kNoVertex));
  const auto fmap = DecodeFunctionalMap(Encoded(ResultPart::kFunctionalMap));
  ASSERT_THAT(fmap, IsOk());
  EXPECT_EQ(fmap->fmap_x_from_y, found.functional_map);
  EXPECT_EQ(fmap->eigenvalues_x, found.eigenvalues_x);
  EXPECT_EQ(fmap->eigenvalues_y, found.eigenvalues_y);
  EXPECT_EQ(*DecodeMask(Encoded(ResultPart::kMaskY), kSize), kMask);
}

TEST(ResultBytesTest, AnotherNumberOfBytesIsDamage) {
  for (const std::size_t missing : {std::size_t{1}, std::size_t{4}}) {
    const auto cut = [&](ResultPart part) {
      std::string bytes = Encoded(part);
      bytes.resize(bytes.size() - missing);
      return bytes;
    };
    EXPECT_THAT(DecodeMap(cut(ResultPart::kMap), kSize), Damaged("expected 8"));
    EXPECT_THAT(DecodePreciseMap(cut(ResultPart::kPreciseMap), kSize),
                Damaged("expected 48"));
    EXPECT_THAT(DecodeConfidence(cut(ResultPart::kConfidence), kSize),
                Damaged("expected 8"));
    EXPECT_THAT(DecodeFunctionalMap(cut(ResultPart::kFunctionalMap)),
                Damaged("expected 68"));
    EXPECT_THAT(DecodeMask(cut(ResultPart::kMaskY), kSize),
                Damaged("expected 9"));
  }
  EXPECT_THAT(DecodeFunctionalMap("\1"), Damaged("expected 4"));
  EXPECT_THAT(DecodeFunctionalMap("\xFF\xFF\xFF\xFF"), Damaged("at most"));
}

TEST(ResultBytesTest, AVertexThatYLacksIsDamage) {
  const PairSize smaller = {2, 8};
  EXPECT_THAT(DecodeMap(Encoded(ResultPart::kMap), smaller),
              Damaged("names vertex 8 of Y, which has 8"));
  EXPECT_THAT(DecodePreciseMap(Encoded(ResultPart::kPreciseMap), smaller),
              Damaged("names vertex 8"));
  EXPECT_THAT(DecodeMap("\xFE\xFF\xFF\xFF", {1, 8}), Damaged("4294967294"));
}

TEST(ResultBytesTest, AMaskHasZerosAndOnesOnly) {
  for (const char byte : {'\2', '1', '\xFF'}) {
    std::string bytes = Encoded(ResultPart::kMaskY);
    bytes[4] = byte;
    EXPECT_THAT(DecodeMask(bytes, kSize), Damaged("expected 0 or 1"));
  }
  EXPECT_THAT(DecodeMask(std::string(8, '\1') + "\xFF", kSize),
              Damaged("a byte 255"));
}

TEST(ResultBytesTest, HalfAFaceIsDamage) {
  std::string bytes = Encoded(ResultPart::kPreciseMap);
  bytes.replace(0, 4, "\xFF\xFF\xFF\xFF");
  EXPECT_THAT(DecodePreciseMap(bytes, kSize), Damaged("expected three"));
}

}  // namespace
}  // namespace isomatch
