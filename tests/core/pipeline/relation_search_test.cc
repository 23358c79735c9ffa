#include "core/pipeline/relation_search.h"

#include <cstdint>
#include <functional>
#include <map>
#include <stop_token>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/mesh/mesh_geometry.h"
#include "core/pipeline/matcher.h"
#include "tests/support/dirty_meshes.h"
#include "tests/support/matchers.h"
#include "tests/support/quick_options.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr ShapeOutline kClosed = {0.1, 1};
constexpr ShapeOutline kOpen = {2, 1};
constexpr ShapeOutline kSmallOpen = {2, 0.4};

/// Finds out a relation where maps are as confident as `confidence` says, and
/// no map is found where it says nothing.
class RelationSearchTest : public testing::Test {
 protected:
  absl::StatusOr<Correspondence> Find(const ShapeOutline& x,
                                      const ShapeOutline& y) {
    tried_.clear();
    seeds_.clear();
    next_scales_.clear();
    MatchOptions options;
    options.relation = relation_;
    options.scale = scale_;
    return FindRelation(
        x, y, options,
        {[this](const Progress& report) { reports_.push_back(report); },
         stop_.get_token(), hurry_.get_token()},
        [this](const MatchOptions& as, const MatchControl& control) {
          return MatchAs(as, control);
        });
  }

  LengthScale scale_ = LengthScale::kSame;
  Relation relation_ = Relation::kAuto;
  std::uint64_t better_seed_ = 0;
  std::uint64_t best_ranked_seed_ = 0;  ///< though it is less confident
  std::uint64_t only_seed_ = 0;
  double confidence_of_it_ = 0;
  std::map<Relation, double> confidence_;
  double better_at_next_scale_ = 0;
  bool no_next_scale_ = false;
  double coverage_ = 1;
  std::vector<Relation> tried_;
  std::vector<LengthScale> scales_;
  std::vector<std::uint64_t> seeds_;
  std::vector<bool> next_scales_;
  std::vector<Progress> reports_;
  std::stop_source stop_;
  std::stop_source hurry_;
  /// Called as the number of a try before it has a map.
  std::function<void(std::size_t)> on_try_ = [](std::size_t) {};

 private:
  absl::StatusOr<Correspondence> MatchAs(const MatchOptions& options,
                                         const MatchControl& control) {
    tried_.push_back(options.relation);
    scales_.push_back(options.scale);
    seeds_.push_back(options.random_seed);
    next_scales_.push_back(options.next_scale);
    for (const auto& [stage, total] :
         {std::pair(Stage::kPrepare, 0.0), std::pair(Stage::kSpectral, 0.3),
          std::pair(Stage::kSeeds, 0.5), std::pair(Stage::kQuality, 0.9)}) {
      control.progress({stage, 0, total, stage == Stage::kQuality});
    }
    on_try_(tried_.size());
    if (control.stop.stop_requested()) return absl::CancelledError("stopped");
    if (options.random_seed == only_seed_) {
      confidence_[options.relation] = confidence_of_it_;
    }
    const auto found = confidence_.find(options.relation);
    if (found == confidence_.end() || (options.next_scale && no_next_scale_)) {
      return absl::FailedPreconditionError(RelationName(options.relation));
    }
    Correspondence map;
    map.relation = options.relation;
    map.ended_early = control.hurry.stop_requested();
    map.quality.mean_confidence = found->second;
    map.scores.rank_value = 1;
    if (options.random_seed == better_seed_) {
      map.quality.mean_confidence += 0.1;
      map.scores.rank_value = 0.5;
    }
    if (options.random_seed == best_ranked_seed_) {
      map.quality.mean_confidence -= 0.05;
      map.scores.rank_value = 0.5;
    }
    if (options.next_scale) {
      map.quality.mean_confidence += better_at_next_scale_;
    }
    map.quality.coverage = coverage_;
    map.verdict = VerdictOf(map);
    return map;
  }
};

TEST_F(RelationSearchTest, ClosedShapesAreWhole) {
  confidence_ = {{Relation::kWhole, 0.1}};
  const auto found = Find(kClosed, kClosed);
  ASSERT_THAT(found, IsOk());
  EXPECT_THAT(tried_, ElementsAre(Relation::kWhole));
  EXPECT_THAT(scales_, ElementsAre(LengthScale::kAuto));
  EXPECT_EQ(found->relation_confidence, 1);
}

TEST_F(RelationSearchTest, OneThatIsOpenIsAPartOfTheOther) {
  confidence_ = {{Relation::kPartOfY, 0.6}, {Relation::kPartOfX, 0.6}};
  auto found = Find(kOpen, kClosed);
  ASSERT_THAT(found, IsOk());
  EXPECT_THAT(tried_, ElementsAre(Relation::kPartOfY));
  EXPECT_THAT(scales_, ElementsAre(LengthScale::kSame));
  EXPECT_EQ(found->relation_confidence, 1);
  found = Find(kClosed, kOpen);
  ASSERT_THAT(found, IsOk());
  EXPECT_EQ(found->relation, Relation::kPartOfX);
}

TEST_F(RelationSearchTest, ABadPartMayBeAWhole) {
  confidence_ = {{Relation::kPartOfY, 0.3}, {Relation::kWhole, 0.5}};
  const auto found = Find(kOpen, kClosed);
  ASSERT_THAT(found, IsOk());
  EXPECT_EQ(found->relation, Relation::kWhole);
  EXPECT_EQ(found->relation_confidence, 1);  // it leads by far
}

TEST_F(RelationSearchTest, OpenShapesAreWhatTheirMapIsMostConfidentAs) {
  confidence_ = {{Relation::kWhole, 0.4},
                 {Relation::kOverlap, 0.67},
                 {Relation::kPartOfY, 0.5},
                 {Relation::kPartOfX, 0.62}};
  auto found = Find(kOpen, kOpen);
  ASSERT_THAT(found, IsOk());
  EXPECT_THAT(tried_, ElementsAre(Relation::kWhole, Relation::kPartOfY,
                                  Relation::kPartOfX, Relation::kOverlap));
  EXPECT_EQ(found->relation, Relation::kOverlap);
  EXPECT_GT(found->relation_confidence, 0.3);
  EXPECT_LT(found->relation_confidence, 0.8);
  EXPECT_THAT(found->warnings, IsEmpty());
  // Maps of parts are a little surer, right or wrong.
  confidence_[Relation::kPartOfX] = 0.68;
  found = Find(kOpen, kOpen);
  EXPECT_EQ(found->relation, Relation::kOverlap);
  // What leaves nothing out is believed as soon.
  confidence_[Relation::kWhole] = 0.64;
  found = Find(kOpen, kOpen);
  EXPECT_EQ(found->relation, Relation::kWhole);
  // Neither is sure then.
  EXPECT_LT(found->relation_confidence, 0.25);
  EXPECT_EQ(found->verdict.level, VerdictLevel::kDoubtful);
  EXPECT_THAT(found->verdict.reason, HasSubstr("another way"));
}

TEST_F(RelationSearchTest, AWholeMapThatIsSureIsNotCompared) {
  confidence_ = {{Relation::kWhole, 0.75}};
  const auto found = Find(kOpen, kOpen);
  ASSERT_THAT(found, IsOk());
  EXPECT_THAT(tried_, ElementsAre(Relation::kWhole));
  EXPECT_EQ(found->relation_confidence, 1);
  EXPECT_EQ(reports_.back().total_fraction, 1);
  coverage_ = 0.9;
  ASSERT_THAT(Find(kOpen, kOpen), IsOk());
  EXPECT_EQ(tried_.size(), 6u);  // three overlaps
}

TEST_F(RelationSearchTest, AreasInOneUnitTell) {
  confidence_ = {{Relation::kWhole, 0.75}};
  ASSERT_THAT(Find({2, 0.8}, kOpen), IsOk());
  EXPECT_EQ(tried_.size(), 5u);
  confidence_ = {{Relation::kOverlap, 0.6}, {Relation::kPartOfY, 0.72}};
  auto found = Find(kSmallOpen, kOpen);
  ASSERT_THAT(found, IsOk());
  EXPECT_THAT(tried_, ElementsAre(Relation::kPartOfY, Relation::kOverlap));
  EXPECT_EQ(found->relation, Relation::kPartOfY);
  // In units that are not known they do not.
  scale_ = LengthScale::kAuto;
  found = Find(kSmallOpen, kOpen);
  ASSERT_THAT(found, IsOk());
  EXPECT_EQ(tried_.size(), 4u);
}

TEST_F(RelationSearchTest, AnOverlapIsTakenToBeInOneUnit) {
  scale_ = LengthScale::kAuto;
  confidence_ = {{Relation::kOverlap, 0.7}};
  const auto found = Find(kOpen, kOpen);
  ASSERT_THAT(found, IsOk());
  EXPECT_THAT(scales_, ElementsAre(LengthScale::kAuto, LengthScale::kAuto,
                                   LengthScale::kAuto, LengthScale::kSame));
  EXPECT_THAT(found->warnings, ElementsAre(HasSubstr("one unit")));
}

TEST_F(RelationSearchTest, AnOverlapThatIsNotConfidentIsLookedForAgain) {
  confidence_ = {{Relation::kOverlap, 0.5}};
  relation_ = Relation::kOverlap;
  const auto found = Find(kOpen, kOpen);
  ASSERT_THAT(found, IsOk());
  EXPECT_THAT(seeds_, ElementsAre(1, 2, 3));
  EXPECT_EQ(found->relation_confidence, 1);
  // One of them may find none.
  confidence_.clear();
  only_seed_ = 3;
  confidence_of_it_ = 0.4;
  ASSERT_THAT(Find(kOpen, kOpen), IsOk());
  EXPECT_EQ(reports_.back().total_fraction, 1);
  only_seed_ = 0;
  confidence_ = {{Relation::kOverlap, 0.6}};
  // The best of them.
  better_seed_ = 2;
  EXPECT_NEAR(Find(kOpen, kOpen)->quality.mean_confidence, 0.7, 1e-9);
  EXPECT_THAT(seeds_, ElementsAre(1, 2));
  // By rank, not by confidence.
  better_seed_ = 0;
  best_ranked_seed_ = 2;
  confidence_ = {{Relation::kOverlap, 0.6}};
  EXPECT_NEAR(Find(kOpen, kOpen)->quality.mean_confidence, 0.55, 1e-9);
  EXPECT_THAT(seeds_, ElementsAre(1, 2, 3));
  // Unless that one is bad, as one that matches nothing would be.
  confidence_ = {{Relation::kOverlap, 0.48}};
  EXPECT_NEAR(Find(kOpen, kOpen)->quality.mean_confidence, 0.48, 1e-9);
}

TEST_F(RelationSearchTest, AnOverlapThatCannotWinIsNotLookedForAgain) {
  confidence_ = {{Relation::kPartOfX, 0.72}, {Relation::kOverlap, 0.6}};
  ASSERT_THAT(Find(kOpen, kOpen), IsOk());
  EXPECT_EQ(tried_.size(), 4u);
  confidence_[Relation::kPartOfX] = 0.68;
  ASSERT_THAT(Find(kOpen, kOpen), IsOk());
  EXPECT_EQ(tried_.size(), 6u);
}

TEST_F(RelationSearchTest, APartOfUnknownScaleIsTriedAtTheNextOne) {
  scale_ = LengthScale::kAuto;
  for (const Relation part : {Relation::kPartOfY, Relation::kPartOfX}) {
    relation_ = part;
    confidence_ = {{part, 0.5}};
    better_at_next_scale_ = 0.1;
    EXPECT_NEAR(Find(kOpen, kOpen)->quality.mean_confidence, 0.6, 1e-9);
    EXPECT_THAT(next_scales_, ElementsAre(false, true));
    EXPECT_THAT(seeds_, ElementsAre(1, 1));
    better_at_next_scale_ = -0.1;
    EXPECT_NEAR(Find(kOpen, kOpen)->quality.mean_confidence, 0.5, 1e-9);
    // Then with another seed, as where there is no other scale.
    EXPECT_THAT(next_scales_, ElementsAre(false, true, false));
    EXPECT_THAT(seeds_, ElementsAre(1, 1, 2));
    no_next_scale_ = true;
    EXPECT_NEAR(Find(kOpen, kOpen)->quality.mean_confidence, 0.5, 1e-9);
    EXPECT_THAT(next_scales_, ElementsAre(false, true, false));
    no_next_scale_ = false;
    confidence_ = {{part, 0.6}};
    ASSERT_THAT(Find(kOpen, kOpen), IsOk());
    EXPECT_THAT(next_scales_, ElementsAre(false));
  }
}

TEST_F(RelationSearchTest, APartInOneUnitIsTriedWithOtherSeeds) {
  for (const Relation told : {Relation::kPartOfY, Relation::kAuto}) {
    relation_ = told;
    confidence_ = {{Relation::kPartOfY, 0.5}};
    ASSERT_THAT(Find(kOpen, kClosed), IsOk());
    EXPECT_THAT(seeds_, ElementsAre(1, 2, 3));
    EXPECT_THAT(next_scales_, ElementsAre(false, false, false));
    better_seed_ = 2;
    EXPECT_NEAR(Find(kOpen, kClosed)->quality.mean_confidence, 0.6, 1e-9);
    EXPECT_THAT(seeds_, ElementsAre(1, 2));
    better_seed_ = 0;
    confidence_ = {{Relation::kPartOfY, 0.6}};
    ASSERT_THAT(Find(kOpen, kClosed), IsOk());
    EXPECT_THAT(seeds_, ElementsAre(1));
  }
}

TEST_F(RelationSearchTest, OfAPartInOneUnitTheMapThatRanksBestIsKept) {
  relation_ = Relation::kPartOfY;
  confidence_ = {{Relation::kPartOfY, 0.5}};
  best_ranked_seed_ = 2;  // a mirrored map may be more confident
  EXPECT_NEAR(Find(kOpen, kClosed)->quality.mean_confidence, 0.45, 1e-9);
  // What ranks better in another unit need not fit better.
  scale_ = LengthScale::kAuto;
  EXPECT_NEAR(Find(kOpen, kClosed)->quality.mean_confidence, 0.5, 1e-9);
  EXPECT_THAT(seeds_, ElementsAre(1, 1, 2));
  // Even if it alone is bad.
  scale_ = LengthScale::kSame;
  confidence_ = {{Relation::kPartOfY, 0.48}};
  const auto found = Find(kOpen, kClosed);
  ASSERT_THAT(found, IsOk());
  EXPECT_NEAR(found->quality.mean_confidence, 0.43, 1e-9);
  EXPECT_EQ(found->verdict.level, VerdictLevel::kBad);
}

TEST_F(RelationSearchTest, AmongOtherRelationsAPartInOneUnitIsTriedOnce) {
  confidence_ = {{Relation::kPartOfY, 0.5}, {Relation::kOverlap, 0.7}};
  ASSERT_THAT(Find(kOpen, kOpen), IsOk());
  EXPECT_THAT(seeds_, ElementsAre(1, 1, 1, 1));
}

TEST_F(RelationSearchTest, ATryThatOthersMayFollowHasMostOfTheProgress) {
  relation_ = Relation::kPartOfY;
  confidence_ = {{Relation::kPartOfY, 0.5}};
  std::vector<double> told;  // when each try has begun to judge its map
  on_try_ = [&](std::size_t) {
    told.push_back(reports_.back().total_fraction);
  };
  ASSERT_THAT(Find(kOpen, kClosed), IsOk());
  ASSERT_EQ(told.size(), 3u);
  EXPECT_GT(told[0], 0.6);
  EXPECT_GT(told[1], told[0]);
  EXPECT_GT(told[2], told[1]);
  EXPECT_LT(told[2], 1);
  EXPECT_EQ(reports_.back().total_fraction, 1);
}

TEST_F(RelationSearchTest, WhereAllFailTheFirstErrorIsTold) {
  const auto found = Find(kOpen, kOpen);
  EXPECT_EQ(found.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(found.status().message(), "whole");
  EXPECT_EQ(tried_.size(), 6u);
}

TEST_F(RelationSearchTest, ProgressNeverFallsAndEndsWithOne) {
  confidence_ = {{Relation::kOverlap, 0.7}};
  ASSERT_THAT(Find(kOpen, kOpen), IsOk());
  ASSERT_EQ(tried_.size(), 4u);
  for (std::size_t i = 1; i < reports_.size(); ++i) {
    EXPECT_GE(reports_[i].total_fraction, reports_[i - 1].total_fraction);
  }
  EXPECT_EQ(reports_.back().total_fraction, 1);
  // The preparation is told of once, and is no try's share.
  EXPECT_EQ(reports_.size(), 2u + 4u * 2u + 1u);
  EXPECT_EQ(reports_[1].total_fraction, 0.3);
}

TEST_F(RelationSearchTest, InAHurryTheFirstMapDoes) {
  confidence_ = {{Relation::kWhole, 0.6}, {Relation::kPartOfY, 0.7}};
  on_try_ = [this](std::size_t number) {
    if (number == 1) hurry_.request_stop();
  };
  const auto found = Find(kOpen, kOpen);
  ASSERT_THAT(found, IsOk());
  EXPECT_THAT(tried_, ElementsAre(Relation::kWhole));
  EXPECT_EQ(found->relation, Relation::kWhole);
  EXPECT_TRUE(found->ended_early);
  EXPECT_EQ(found->relation_confidence, 0);
}

TEST_F(RelationSearchTest, AHurriedMapIsNotSurelyWhole) {
  confidence_ = {{Relation::kWhole, 0.8}};
  on_try_ = [this](std::size_t) { hurry_.request_stop(); };
  const auto found = Find(kOpen, kOpen);
  ASSERT_THAT(found, IsOk());
  EXPECT_TRUE(found->ended_early);
  EXPECT_EQ(found->relation_confidence, 0);
}

TEST_F(RelationSearchTest, AHurryEndsTheTryThatARivalWaitsFor) {
  relation_ = Relation::kOverlap;
  confidence_ = {{Relation::kOverlap, 0.5}};
  on_try_ = [this](std::size_t number) {
    if (number == 2) hurry_.request_stop();
  };
  const auto found = Find(kOpen, kOpen);
  ASSERT_THAT(found, IsOk());
  EXPECT_EQ(tried_.size(), 2u);
  EXPECT_TRUE(found->ended_early);
  // What the user says is sure.
  EXPECT_EQ(found->relation_confidence, 1);
  for (std::size_t i = 1; i < reports_.size(); ++i) {
    EXPECT_GE(reports_[i].has_map, reports_[i - 1].has_map);
  }
}

TEST_F(RelationSearchTest, AHurryWaitsForTheFirstMap) {
  hurry_.request_stop();
  confidence_ = {{Relation::kOverlap, 0.5}};
  const auto found = Find(kOpen, kOpen);
  ASSERT_THAT(found, IsOk());
  EXPECT_EQ(found->relation, Relation::kOverlap);
  EXPECT_EQ(tried_.back(), Relation::kOverlap);
}

TEST_F(RelationSearchTest, AStopIsNoHurry) {
  confidence_ = {{Relation::kWhole, 0.6}};
  on_try_ = [this](std::size_t number) {
    if (number == 2) stop_.request_stop();
  };
  EXPECT_EQ(Find(kOpen, kOpen).status().code(), absl::StatusCode::kCancelled);
}

TEST(FindRelationTest, OtherErrorsAreNotPassedOver) {
  const auto found = FindRelation(
      kOpen, kOpen, MatchOptions(), {},
      [](const MatchOptions&, const MatchControl&) {
        return absl::StatusOr<Correspondence>(absl::CancelledError("ended"));
      });
  EXPECT_EQ(found.status().code(), absl::StatusCode::kCancelled);
}

TEST(OutlineOfTest, IsThatOfASquare) {
  const ShapeOutline outline = OutlineOf(PlaneGrid(5, 5, 1, 1));
  EXPECT_NEAR(outline.rim, 4, 1e-12);
  EXPECT_EQ(OutlineOf(UnitSphere(2)).rim, 0);
}

TEST(MatchAutoTest, ClosedShapesAreMatchedAsWholes) {
  const TriangleMesh x = FiveArms(4);
  const TriangleMesh y = Moved(x, 2);
  MatchOptions options = QuickOptions();
  const auto as_wholes = Match(x, y, {}, options);
  options.relation = Relation::kAuto;
  const auto found = Match(x, y, {}, options);
  ASSERT_THAT(as_wholes, IsOk());
  ASSERT_THAT(found, IsOk());
  EXPECT_EQ(found->relation, Relation::kWhole);
  EXPECT_EQ(found->y_from_x, as_wholes->y_from_x);
  EXPECT_EQ(found->confidence, as_wholes->confidence);
}

TEST(MatchAutoTest, APartIsMatchedAsOneOnEitherSide) {
  const TriangleMesh whole = FiveArms(4);
  const DirtyMesh part =
      MovedPart(whole, Beyond({-0.5, -0.6, 0.3}, 0.1), /*seed=*/6, 1);
  MatchOptions options = QuickOptions();
  options.scale = LengthScale::kSame;
  options.relation = Relation::kPartOfY;
  const auto as_told = Match(part.mesh, whole, {}, options);
  options.relation = Relation::kAuto;
  const auto found = Match(part.mesh, whole, {}, options);
  const auto turned = Match(whole, part.mesh, {}, options);
  ASSERT_THAT(as_told, IsOk());
  ASSERT_THAT(found, IsOk());
  ASSERT_THAT(turned, IsOk());
  EXPECT_EQ(found->relation, Relation::kPartOfY);
  EXPECT_EQ(found->y_from_x, as_told->y_from_x);
  EXPECT_EQ(turned->relation, Relation::kPartOfX);
  EXPECT_THAT(turned->y_from_x, Contains(kNoVertex));
}

/// Shapes that nobody else holds are changed by a match, but not where another
/// follows.
TEST(MatchAutoTest, OpenShapesAreComparedAtAnyThreadCount) {
  const TriangleMesh whole = FiveArms(4);
  const FacePredicate of_y = Beyond({1, 0.1, 0.05}, 0.6);
  const FacePredicate of_x = Beyond({-0.5, -0.6, 0.3}, 0.1);
  const DirtyMesh x = MovedPart(
      whole,
      [&](const TriangleMesh& mesh, VertexIndex face) {
        return of_x(mesh, face) || of_y(mesh, face);
      },
      /*seed=*/6, 1);
  const DirtyMesh y = MovedPart(whole, of_y, /*seed=*/7, 1);
  MatchOptions options = QuickOptions();
  options.scale = LengthScale::kSame;
  options.relation = Relation::kAuto;
  std::vector<Correspondence> found;
  for (const int threads : {1, 3}) {
    options.threads = threads;
    auto one = Match(x.mesh, y.mesh, {}, options);
    ASSERT_THAT(one, IsOk());
    found.push_back(*std::move(one));
  }
  EXPECT_EQ(found[0].y_from_x, found[1].y_from_x);
  EXPECT_NE(found[0].relation, Relation::kWhole);
  EXPECT_EQ(found[0].relation, found[1].relation);
  EXPECT_EQ(found[0].relation_confidence, found[1].relation_confidence);
  options.relation = found[0].relation;
  const auto as_told = Match(x.mesh, y.mesh, {}, options);
  ASSERT_THAT(as_told, IsOk());
  EXPECT_EQ(found[0].y_from_x, as_told->y_from_x);
}

}  // namespace
}  // namespace isomatch
