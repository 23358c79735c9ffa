// Relations where some vertices of X have no counterpart: Y is a part of X, or
// both are parts.

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/evaluation/geodesic_error.h"
#include "core/mesh/mesh_size.h"
#include "core/mesh/topology.h"
#include "core/pipeline/matcher.h"
#include "core/pipeline/memory_estimate.h"
#include "tests/support/dirty_meshes.h"
#include "tests/support/matchers.h"
#include "tests/support/memory_growth.h"
#include "tests/support/quick_options.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::Each;
using testing::HasSubstr;

/// Of two masks.
template <typename Mask>
double Iou(const Mask& a, const Mask& b) {
  double both = 0;
  double either = 0;
  for (std::size_t v = 0; v < a.size(); ++v) {
    both += a[v] && b[v];
    either += a[v] || b[v];
  }
  return both / either;
}

std::vector<char> Matched(const VertexMap& map) {
  std::vector<char> matched;
  for (const VertexIndex y : map) matched.push_back(y != kNoVertex);
  return matched;
}

/// Where a map has no image, nothing else is said either.
void ExpectConsistent(const Correspondence& found) {
  int unmatched = 0;
  for (std::size_t x = 0; x < found.y_from_x.size(); ++x) {
    const bool matched = found.y_from_x[x] != kNoVertex;
    unmatched += !matched;
    EXPECT_EQ(found.precise[x].vertices[0] != kNoVertex, matched);
    EXPECT_EQ(found.confidence[x] > 0, matched);
  }
  EXPECT_EQ(found.quality.unmatched, unmatched);
}

class PartOfXTest : public testing::Test {
 protected:
  static constexpr double kPartScale = 3;

  PartOfXTest()
      : part_(MovedPart(whole_, Beyond({-0.5, -0.6, 0.3}, 0.1), /*seed=*/6,
                        kPartScale)),
        options_(QuickOptions()) {
    options_.relation = Relation::kPartOfX;
  }

  /// 1 for the vertices of the whole that the part has.
  std::vector<char> InPart() const {
    std::vector<char> mask(whole_.num_vertices(), false);
    for (const VertexIndex v : part_.origin) mask[v] = true;
    return mask;
  }

  /// Of where vertices of the whole go, on the whole.
  double ErrorOf(const VertexMap& map) const {
    VertexMap back(map.size(), kNoVertex);
    for (std::size_t x = 0; x < map.size(); ++x) {
      if (map[x] != kNoVertex) back[x] = part_.origin[map[x]];
    }
    return GeodesicErrorMeter(whole_)
        .Measure(back, IdentityMap(whole_.num_vertices()))
        ->mean_over_diameter;
  }

  TriangleMesh PartInOneUnit() const {
    return {part_.mesh.positions / kPartScale, part_.mesh.faces};
  }

  TriangleMesh whole_ = FiveArms(4);
  DirtyMesh part_;
  MatchOptions options_;
};

TEST_F(PartOfXTest, VerticesThatYHasAreFoundAndTheOthersHaveNone) {
  options_.scale = LengthScale::kSame;
  const auto found = Match(whole_, PartInOneUnit(), {}, options_);
  ASSERT_THAT(found, IsOk());
  EXPECT_LT(ErrorOf(found->y_from_x), 0.01);
  EXPECT_GT(Iou(Matched(found->y_from_x), InPart()), 0.9);
  EXPECT_THAT(found->matched_y, Each(1));
  ExpectConsistent(*found);
  EXPECT_EQ(found->relation, Relation::kPartOfX);
  EXPECT_EQ(found->scale, 1);
  EXPECT_EQ(found->verdict.level, VerdictLevel::kGood) << found->verdict.reason;
  EXPECT_GT(found->area_x, found->area_y);
}

TEST_F(PartOfXTest, ConfidenceFallsTowardWhatYLacks) {
  options_.scale = LengthScale::kSame;
  const auto found = Match(whole_, PartInOneUnit(), {}, options_);
  ASSERT_THAT(found, IsOk());
  const std::vector<char> matched = Matched(found->y_from_x);
  std::vector<char> at_rim(matched.size(), false);
  for (VertexIndex f = 0; f < whole_.num_faces(); ++f) {
    for (int corner = 0; corner < 3; ++corner) {
      if (matched[whole_.faces(f, (corner + 1) % 3)]) continue;
      at_rim[whole_.faces(f, corner)] = true;
    }
  }
  double sums[2] = {0, 0};
  int counts[2] = {0, 0};
  for (std::size_t v = 0; v < matched.size(); ++v) {
    if (!matched[v]) continue;
    sums[int{at_rim[v]}] += found->confidence[v];
    ++counts[int{at_rim[v]}];
  }
  ASSERT_GT(counts[1], 0);
  EXPECT_LT(sums[1] / counts[1], 0.8 * sums[0] / counts[0]);
}

TEST_F(PartOfXTest, ItIsTheOtherWayRoundOfAPartOfY) {
  options_.keep_functional_map = true;
  const auto found = Match(whole_, part_.mesh, {}, options_);
  ASSERT_THAT(found, IsOk());
  EXPECT_LT(ErrorOf(found->y_from_x), 0.02);
  EXPECT_NEAR(found->scale / kPartScale, 1, 0.04);
  MatchOptions turned = options_;
  turned.relation = Relation::kPartOfY;
  const auto other = Match(part_.mesh, whole_, {}, turned);
  ASSERT_THAT(other, IsOk());
  EXPECT_DOUBLE_EQ(found->scale * other->scale, 1);
  EXPECT_EQ(found->functional_map, other->functional_map.transpose());
  EXPECT_EQ(found->eigenvalues_x, other->eigenvalues_y);
  ASSERT_EQ(found->sparse_matches.size(), other->sparse_matches.size());
  for (std::size_t i = 0; i < found->sparse_matches.size(); ++i) {
    EXPECT_EQ(found->sparse_matches[i].x, other->sparse_matches[i].y);
    EXPECT_EQ(found->sparse_matches[i].y, other->sparse_matches[i].x);
  }
  // What the one leaves free the other leaves out.
  EXPECT_EQ(other->matched_y, Matched(found->y_from_x));
  EXPECT_GT(Iou(other->matched_y, InPart()), 0.9);
}

TEST_F(PartOfXTest, TheSameBytesAtAnyThreadCountAndOfPreparedShapes) {
  options_.threads = 1;
  const auto alone = Match(whole_, part_.mesh, {}, options_);
  ASSERT_THAT(alone, IsOk());
  options_.threads = 4;
  const auto x = Prepare(whole_, QuickOptions());
  const auto y = Prepare(part_.mesh, QuickOptions());
  ASSERT_THAT(x, IsOk());
  ASSERT_THAT(y, IsOk());
  for (int again = 0; again < 2; ++again) {
    const auto prepared = MatchPrepared(*x, *y, {}, options_);
    ASSERT_THAT(prepared, IsOk());
    EXPECT_EQ(prepared->y_from_x, alone->y_from_x);
    EXPECT_EQ(prepared->confidence, alone->confidence);
    EXPECT_EQ(prepared->matched_y, alone->matched_y);
  }
}

TEST_F(PartOfXTest, LandmarksAreKeptAndFaultsNameTheirSide) {
  options_.scale = LengthScale::kSame;
  const std::vector<Landmark> landmarks = {{part_.origin[5], 5},
                                           {part_.origin[200], 200}};
  const auto found = Match(whole_, PartInOneUnit(), landmarks, options_);
  ASSERT_THAT(found, IsOk());
  EXPECT_LT(ErrorOf(found->y_from_x), 0.01);
  for (const Landmark& landmark : landmarks) {
    EXPECT_EQ(found->y_from_x[landmark.x], landmark.y);
  }
  ExpectConsistent(*found);
  const DirtyMesh stray = WithLoneVertices(Untouched(PartInOneUnit()), 4);
  const auto on_no_face =
      std::find(stray.origin.begin(), stray.origin.end(), kNoVertex);
  const auto lone = static_cast<VertexIndex>(on_no_face - stray.origin.begin());
  const std::vector<Landmark> wrong = {{3, lone}};
  EXPECT_THAT(Match(whole_, stray.mesh, wrong, options_),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("landmarks[0].y")));
}

TEST_F(PartOfXTest, DecimatedShapesAreLifted) {
  options_.solved_vertices = 1200;
  const auto found = Match(whole_, part_.mesh, {}, options_);
  ASSERT_THAT(found, IsOk());
  EXPECT_LT(ErrorOf(found->y_from_x), 0.02);
  EXPECT_GT(Iou(Matched(found->y_from_x), InPart()), 0.85);
  ExpectConsistent(*found);
}

/// Two parts of one shape. How well they are matched is told by
/// tests/client/sample/animal_parts_test.cc.
class OverlapTest : public testing::Test {
 protected:
  OverlapTest()
      : x_(MovedPart(whole_, Beyond({-0.5, -0.6, 0.3}, 0.35), /*seed=*/6, 1)),
        y_(MovedPart(whole_, Beyond({0.8, 0.1, -0.3}, 0.55), /*seed=*/8, 1)),
        options_(QuickOptions()) {
    options_.relation = Relation::kOverlap;
    options_.scale = LengthScale::kSame;
  }

  TriangleMesh whole_ = FiveArms(4);
  DirtyMesh x_;
  DirtyMesh y_;
  MatchOptions options_;
};

TEST_F(OverlapTest, TheSameBytesAtAnyThreadCount) {
  options_.threads = 1;
  const auto alone = Match(x_.mesh, y_.mesh, {}, options_);
  ASSERT_THAT(alone, IsOk());
  ExpectConsistent(*alone);
  EXPECT_EQ(alone->relation, Relation::kOverlap);
  options_.threads = 4;
  const auto together = Match(x_.mesh, y_.mesh, {}, options_);
  ASSERT_THAT(together, IsOk());
  EXPECT_EQ(alone->y_from_x, together->y_from_x);
  EXPECT_EQ(alone->confidence, together->confidence);
  EXPECT_EQ(alone->matched_y, together->matched_y);
}

TEST_F(OverlapTest, ProgressNeverFallsAndEnds) {
  std::vector<double> totals;
  const auto found =
      Match(x_.mesh, y_.mesh, {}, options_, {[&](const Progress& progress) {
              totals.push_back(progress.total_fraction);
            }});
  ASSERT_THAT(found, IsOk());
  EXPECT_TRUE(std::is_sorted(totals.begin(), totals.end()));
  EXPECT_EQ(totals.back(), 1);
}

TEST_F(OverlapTest, TheMemoryEstimateIsAnUpperBound) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers change what a process allocates";
#endif
  for (const Relation relation : {Relation::kOverlap, Relation::kPartOfX}) {
    MatchOptions options;
    options.relation = relation;
    options.scale = LengthScale::kSame;
    const TriangleMesh& x = relation == Relation::kOverlap ? x_.mesh : whole_;
    const MemoryGrowth growth;
    ASSERT_THAT(Match(x, y_.mesh, {}, options), IsOk());
    const std::int64_t measured = growth.Bytes();
    const std::int64_t estimate =
        EstimateMemoryBytes(SizeOf(x), SizeOf(y_.mesh), 0, options);
    RecordProperty("measured_bytes", std::to_string(measured));
    RecordProperty("estimate_bytes", std::to_string(estimate));
    EXPECT_GE(estimate, measured);
    EXPECT_LE(estimate, 2 * measured + (std::int64_t{16} << 20));
  }
}

TEST(OverlapOptionsTest, TheirUnitHasToBeKnown) {
  MatchOptions options;
  options.relation = Relation::kOverlap;
  EXPECT_THAT(options.Validate(),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("options.scale: auto, expected same")));
  options.scale = LengthScale::kSame;
  EXPECT_THAT(options.Validate(), IsOk());
}

}  // namespace
}  // namespace isomatch
