#include "core/pipeline/verdict.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/pipeline/correspondence.h"
#include "core/pipeline/matcher.h"
#include "tests/support/dirty_meshes.h"
#include "tests/support/matchers.h"
#include "tests/support/quick_options.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

/// What a good map looks like.
Correspondence Good() {
  Correspondence found;
  found.quality = {.geodesic_distortion = 0.03,
                   .coverage = 1,
                   .area_distortion = 0.2,
                   .mean_confidence = 0.8};
  found.scores.orientation_score = 0.9;
  return found;
}

TEST(VerdictTest, AGoodMapNeedsNoAdvice) {
  const Verdict verdict = VerdictOf(Good());
  EXPECT_EQ(verdict.level, VerdictLevel::kGood);
  EXPECT_EQ(verdict.reason, "mean confidence 0.8");
  EXPECT_THAT(verdict.advice, IsEmpty());
}

TEST(VerdictTest, LowConfidenceIsBadWhateverElseIsRight) {
  Correspondence found = Good();
  for (const double confidence :
       {0.0, 0.44, std::numeric_limits<double>::quiet_NaN()}) {
    found.quality.mean_confidence = confidence;
    EXPECT_EQ(VerdictOf(found).level, VerdictLevel::kBad);
    EXPECT_THAT(VerdictOf(found).advice, Not(IsEmpty()));
  }
}

TEST(VerdictTest, WhatIsWrongDecidesTheAdvice) {
  Correspondence found = Good();
  found.quality.mean_confidence = 0.1;
  found.quality.area_distortion = 6;
  EXPECT_THAT(VerdictOf(found).advice, HasSubstr("weld"));
  found.quality.area_distortion = 1;
  EXPECT_THAT(VerdictOf(found).reason, HasSubstr("factor of 2.7"));
  EXPECT_THAT(VerdictOf(found).advice, HasSubstr("same kind of shape"));
  found.quality.coverage = 0.5;
  EXPECT_THAT(VerdictOf(found).reason, HasSubstr("50 % of the area of Y"));
  EXPECT_THAT(VerdictOf(found).advice, HasSubstr("part"));
}

TEST(VerdictTest, AnOverlapThatLeavesOutMostOfBothIsDoubtful) {
  Correspondence found = Good();
  found.relation = Relation::kOverlap;
  found.y_from_x.assign(100, 0);
  found.quality.unmatched = 60;
  found.quality.coverage = 0.3;
  EXPECT_EQ(VerdictOf(found).level, VerdictLevel::kDoubtful);
  EXPECT_EQ(VerdictOf(found).reason,
            "only 40 % of X and 30 % of Y are matched");
  // One of them may be large.
  found.quality.coverage = 0.9;
  EXPECT_EQ(VerdictOf(found).level, VerdictLevel::kGood);
  found.quality = {.coverage = 0.3, .unmatched = 0, .mean_confidence = 0.8};
  EXPECT_EQ(VerdictOf(found).level, VerdictLevel::kGood);
}

TEST(VerdictTest, AWholeThatIsNotSureHasToCoverNearlyAll) {
  Correspondence found = Good();
  found.quality.coverage = 0.95;
  EXPECT_EQ(VerdictOf(found).level, VerdictLevel::kGood);
  found.relation_confidence = 0.9;
  EXPECT_EQ(VerdictOf(found).level, VerdictLevel::kDoubtful);
  EXPECT_EQ(VerdictOf(found).reason,
            "only 95 % of the area of Y has a counterpart");
  found.quality.coverage = 0.98;
  EXPECT_EQ(VerdictOf(found).level, VerdictLevel::kGood);
  found.relation = Relation::kPartOfY;
  found.quality.coverage = 0.3;
  EXPECT_EQ(VerdictOf(found).level, VerdictLevel::kGood);
}

TEST(VerdictTest, EachDoubtIsToldWithWhatToDo) {
  const auto expect_doubt = [](const Correspondence& found,
                               const char* reason) {
    EXPECT_EQ(VerdictOf(found).level, VerdictLevel::kDoubtful);
    EXPECT_THAT(VerdictOf(found).reason, HasSubstr(reason));
    EXPECT_THAT(VerdictOf(found).advice, Not(IsEmpty()));
  };
  Correspondence found = Good();
  found.quality.mean_confidence = 0.55;
  expect_doubt(found, "mean confidence 0.55");
  found = Good();
  found.scores.orientation_score = -0.5;
  expect_doubt(found, "mirrored");
  found = Good();
  found.symmetry_confidence = 0.1;
  expect_doubt(found, "mirrored");
  found = Good();
  found.quality.coverage = 0.8;
  expect_doubt(found, "80 %");
  found = Good();
  found.quality.area_distortion = 0.7;
  expect_doubt(found, "factor of 2");
  found = Good();
  found.ended_early = true;
  found.scores.stretch = 0.1;
  EXPECT_EQ(VerdictOf(found).level, VerdictLevel::kGood);
  found.symmetry_confidence = 0.1;  // rivals were compared
  expect_doubt(found, "fits nearly as well");
  found.symmetry_confidence = 0;
  expect_doubt(found, "no time to compare");
  found.relation_confidence = 0;
  expect_doubt(found, "parts of each other");
  found = Good();
  found.ended_early = true;
  found.scores.stretch = 0;
  expect_doubt(found, "no time to refine");
}

TEST(VerdictTest, AWholeMapThatIsTornIsDoubtful) {
  Correspondence torn = Good();
  torn.scores.stretch = 0.11;
  torn.scores.normal_mismatch = 0.04;
  EXPECT_EQ(VerdictOf(torn).level, VerdictLevel::kDoubtful);
  EXPECT_THAT(VerdictOf(torn).reason, HasSubstr("torn"));
  torn.relation = Relation::kPartOfY;  // of which more normals differ
  EXPECT_EQ(VerdictOf(torn).level, VerdictLevel::kGood);
}

TEST(VerdictTest, OfRealMapsTheRightOnesAreGood) {
  const TriangleMesh shape = FiveArms(3);
  const auto same = Match(shape, shape, {}, QuickOptions());
  ASSERT_THAT(same, IsOk());
  EXPECT_EQ(same->verdict.level, VerdictLevel::kGood) << same->verdict.reason;
  EXPECT_GT(same->quality.mean_confidence, 0.6);
  // A torus is no hand.
  const auto unlike = Match(shape, Torus(40, 16), {}, QuickOptions());
  ASSERT_THAT(unlike, IsOk());
  EXPECT_EQ(unlike->verdict.level, VerdictLevel::kBad)
      << unlike->verdict.reason;
  // Nor do faces that hang together nowhere make a surface.
  TriangleMesh soup = TriangleSoup(Untouched(shape)).mesh;
  soup.positions += 1e-6 * Positions::Random(soup.positions.rows(), 3);
  const auto torn = Match(soup, shape, {}, QuickOptions());
  ASSERT_THAT(torn, IsOk());
  EXPECT_EQ(torn->verdict.level, VerdictLevel::kBad) << torn->verdict.reason;
  EXPECT_THAT(torn->verdict.advice, HasSubstr("weld"));
}

TEST(VerdictTest, APreparedPairGetsTheSame) {
  const TriangleMesh shape = FiveArms(3);
  const auto prepared = PrepareBoth(shape, shape, QuickOptions());
  ASSERT_THAT(prepared, IsOk());
  const auto found =
      MatchPrepared(prepared->x, prepared->y, {}, QuickOptions());
  ASSERT_THAT(found, IsOk());
  EXPECT_EQ(found->verdict.level, VerdictLevel::kGood);
}

}  // namespace
}  // namespace isomatch
