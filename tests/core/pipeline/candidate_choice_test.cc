#include "core/pipeline/candidate_choice.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stop_token>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "absl/algorithm/container.h"
#include "core/base/random_stream.h"
#include "core/evaluation/geodesic_error.h"
#include "core/mesh/clean_mesh.h"
#include "core/mesh/mesh_geometry.h"
#include "core/mesh/vertex_stars.h"
#include "core/pipeline/matcher.h"
#include "core/pipeline/preparation.h"
#include "core/pipeline/progress_reporter.h"
#include "core/pipeline/stage_plan.h"
#include "tests/core/pipeline/two_poses.h"
#include "tests/support/dirty_meshes.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

/// Signs against a map, all so many times what they are of another.
Candidate WithSigns(double factor) {
  Candidate candidate;
  candidate.scores.curvature_mismatch = 2 * factor;
  candidate.scores.normal_mismatch = 0.03 * factor;
  candidate.scores.descriptor_mismatch = 0.4 * factor;
  candidate.dense_mismatch = 0.5 * factor;
  candidate.first_signs = {0.05 * factor, 0.06 * factor, 0.02 * factor};
  return candidate;
}

TEST(MisfitOfTest, IsAProductOfPowers) {
  const MatchOptions options;
  const double one = MisfitOf(WithSigns(1), true, options);
  EXPECT_NEAR(one, 2 * 2 * 0.03 * 0.4 * 0.4 * 0.0625 * 0.05, 1e-12);
  EXPECT_NEAR(MisfitOf(WithSigns(2), true, options), 1024 * one, 1e-9);
  // Eq. 8 tells nothing here.
  Candidate other = WithSigns(1);
  other.scores.embedding_error = 7;
  EXPECT_EQ(MisfitOf(other, true, options), one);
  other.scores.landmark_contradiction = 1;
  EXPECT_GT(MisfitOf(other, true, options), 2 * one);
}

TEST(MisfitOfTest, WhatIsPerfectOrNoNumberCompares) {
  const MatchOptions options;
  const double perfect = MisfitOf(Candidate(), true, options);
  EXPECT_GT(perfect, 0);
  EXPECT_LT(perfect, MisfitOf(WithSigns(1), true, options));
  Candidate broken = WithSigns(1);
  broken.first_signs.stretch = std::numeric_limits<double>::quiet_NaN();
  EXPECT_GT(MisfitOf(broken, true, options),
            MisfitOf(WithSigns(1.2), true, options));
}

TEST(MisfitOfTest, WithoutOrientationTheStretchStandsForNormals) {
  Candidate one = WithSigns(1);
  one.scores.normal_mismatch = 0;
  one.scores.stretch = 0.1;
  Candidate other = one;
  other.scores.stretch = 0.2;
  const MatchOptions options;
  EXPECT_NEAR(MisfitOf(other, false, options) / MisfitOf(one, false, options),
              2, 1e-9);
}

TEST(MisfitOfTest, OfAPartTheStretchOfTheWholeCounts) {
  MatchOptions options;
  options.relation = Relation::kPartOfY;
  Candidate part = WithSigns(1);
  part.scores.stretch = 0.2;
  EXPECT_NEAR(MisfitOf(part, true, options), 0.2 * 0.03 * 0.4, 1e-12);
  EXPECT_NEAR(MisfitOf(part, false, options), 0.2 * 0.4, 1e-12);
  part.scores.landmark_contradiction = 1;
  EXPECT_GT(MisfitOf(part, true, options), 2 * 0.2 * 0.03 * 0.4);
}

TEST(IsFarBehindTest, TwoSignsHaveToSaySoEachAlone) {
  const FirstSigns leading = {0.05, 0.06, 0.02};
  EXPECT_TRUE(IsFarBehind({0.15, 0.12, 0.04}, leading));
  EXPECT_FALSE(IsFarBehind({0.1, 0.09, 0.03}, leading));   // not far
  EXPECT_FALSE(IsFarBehind({5, 0.06, 0.06}, leading));     // not by normals
  EXPECT_FALSE(IsFarBehind({5, 0.18, 0.02}, leading));     // not by movement
  EXPECT_FALSE(IsFarBehind(leading, {0.15, 0.12, 0.04}));  // ahead
}

TEST(RankLostTest, WhatWasGivenUpMakesNothingSure) {
  std::vector<Candidate> candidates(3);
  candidates[0].scores.rank_value = 2;
  candidates[1].scores.rank_value = 9;
  candidates[2].scores.rank_value = 1;
  candidates[2].is_lost = true;
  EXPECT_TRUE(RanksBefore(candidates[1], candidates[2]));
  RankLost(&candidates);
  EXPECT_EQ(candidates[2].scores.rank_value, 9);
  candidates.erase(candidates.begin() + 1);
  candidates[1].scores.rank_value = 1e9;
  RankLost(&candidates);
  EXPECT_LT(SymmetryConfidence(MatchOptions(), candidates), 0.7);
}

TEST(SymmetryConfidenceTest, IsHowFarTheNextIsBehind) {
  std::vector<Candidate> candidates(2);
  candidates[0].scores.rank_value = 1;
  candidates[1].scores.rank_value = 4;
  const MatchOptions options;
  EXPECT_EQ(SymmetryConfidence(options, candidates), 0.75);
  KeepFirst(1, &candidates);
  EXPECT_EQ(SymmetryConfidence(options, candidates), 1);
}

/// Every image walks so many edges of `stars` in random directions: maps that
/// grew from matches are off like that.
VertexMap WalkedAtRandom(VertexMap map, int steps, const VertexStars& stars) {
  RandomStream random(/*random_seed=*/1, /*index=*/1);
  for (VertexIndex& y : map) {
    for (int step = 0; step < steps; ++step) {
      const auto near = stars.Neighbors(y);
      y = near[random.Below(static_cast<std::int64_t>(near.size()))];
    }
  }
  return map;
}

/// Two poses of a body, prepared; maps are planted as candidates.
class CandidateChoiceTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_FALSE(poses_.truth.empty());
    const auto found = Match(poses_.x, poses_.y, {}, options_);
    ASSERT_THAT(found, IsOk());
    ASSERT_FALSE(found->alternatives.empty());
    // The half turn: it keeps orientation, and nearly all distances, but is
    // farther from the truth than any other.
    loser_ = absl::c_max_element(found->alternatives, [&](const auto& a,
                                                          const auto& b) {
               return poses_.ErrorOf(a.y_from_x) < poses_.ErrorOf(b.y_from_x);
             })->y_from_x;
    ProgressReporter progress({}, StagePlan(options_));
    ASSERT_THAT(
        PrepareMeshes({MeshToPrepare{Clean(poses_.x, {}).value(), "mesh_x"},
                       MeshToPrepare{Clean(poses_.y, {}).value(), "mesh_y"}},
                      options_, &progress, {}, &prepared_),
        IsOk());
    loser_ = Working(loser_);
    winner_ = Working(poses_.truth);
    ASSERT_GT(ErrorOf(loser_), 0.1);
    ASSERT_LT(ErrorOf(winner_), 1e-9);
  }

  /// A map between the vertices as they are numbered in preparation.
  VertexMap Working(const VertexMap& map) const {
    VertexMap working;
    for (const VertexIndex x : prepared_[kX].solved().user_from_working) {
      working.push_back(prepared_[kY].solved().working_from_user[map[x]]);
    }
    return working;
  }

  /// `map`: a working one.
  static Candidate Planted(const VertexMap& map, double embedding_error) {
    Candidate candidate;
    candidate.y_from_x = map;
    candidate.scores.embedding_error = embedding_error;
    candidate.scores.curvature_mismatch = 3;
    candidate.scores.rank_value = embedding_error;
    return candidate;
  }

  VertexMap Rough(VertexMap map, int steps) const {
    return WalkedAtRandom(std::move(map), steps, prepared_[kY].solved().stars);
  }

  /// Sorts them; the first was chosen.
  void Choose(std::vector<Candidate>* candidates) const {
    const StopTokens stops;
    CandidateChoice choice(prepared_[kX], prepared_[kY], options_, stops);
    const auto alignment = choice.Choose([](double) {}, candidates);
    ASSERT_THAT(alignment, IsOk());
    ASSERT_NE(*alignment, nullptr);
    EXPECT_EQ((*alignment)->y_from_x(), candidates->front().y_from_x);
  }

  double ErrorOf(const VertexMap& working) const {
    VertexMap map(working.size());
    for (std::size_t x = 0; x < working.size(); ++x) {
      map[prepared_[kX].solved().user_from_working[x]] =
          prepared_[kY].solved().user_from_working[working[x]];
    }
    return poses_.ErrorOf(map);
  }

  MatchOptions options_;
  const TwoPoses poses_ = ReadTwoPoses(ISOMATCH_TEST_DATA);
  VertexMap loser_;   ///< working
  VertexMap winner_;  ///< working
  std::array<PreparedMesh, 2> prepared_;
};

TEST_F(CandidateChoiceTest, APlantedLoserLosesHoweverFarItLed) {
  std::vector<Candidate> candidates = {Planted(Rough(loser_, 2), 0.001),
                                       Planted(Rough(winner_, 2), 0.1)};
  Choose(&candidates);
  ASSERT_EQ(candidates.size(), 2u);
  EXPECT_LT(ErrorOf(candidates[0].y_from_x), 0.03);
  EXPECT_GT(ErrorOf(candidates[1].y_from_x), 0.1);
  EXPECT_GT(SymmetryConfidence(options_, candidates), 0.5);
}

// What begins badly must not be given up for what begins well.
TEST_F(CandidateChoiceTest, ARougherMapThatIsRightWins) {
  std::vector<Candidate> candidates = {Planted(Rough(loser_, 2), 0.001),
                                       Planted(Rough(winner_, 3), 0.1)};
  Choose(&candidates);
  EXPECT_LT(ErrorOf(candidates[0].y_from_x), 0.03);
}

TEST_F(CandidateChoiceTest, InAHurryTheMapThatLooksMostAlikeIsLeft) {
  std::stop_source hurry;
  hurry.request_stop();
  const StopTokens stops = {{}, hurry.get_token()};
  CandidateChoice choice(prepared_[kX], prepared_[kY], options_, stops);
  const VertexMap right = Rough(winner_, 2);
  std::vector<Candidate> candidates = {Planted(Rough(loser_, 2), 0.001),
                                       Planted(right, 0.1)};
  const auto alignment = choice.Choose([](double) {}, &candidates);
  ASSERT_THAT(alignment, IsOk());
  EXPECT_EQ(*alignment, nullptr);
  ASSERT_EQ(candidates.size(), 1u);
  EXPECT_EQ(candidates[0].y_from_x, right);
}

TEST_F(CandidateChoiceTest, WhatIsBegunWhenItHurriesIsJudgedToo) {
  std::stop_source hurry;
  const StopTokens stops = {{}, hurry.get_token()};
  CandidateChoice choice(prepared_[kX], prepared_[kY], options_, stops);
  std::vector<Candidate> candidates = {Planted(Rough(loser_, 2), 0.001),
                                       Planted(Rough(winner_, 2), 0.1),
                                       Planted(Rough(winner_, 3), 0.1)};
  // During the rounds of the second one.
  const auto alignment = choice.Choose(
      [&](double fraction) {
        if (fraction > 0.34) hurry.request_stop();
      },
      &candidates);
  ASSERT_THAT(alignment, IsOk());
  ASSERT_NE(*alignment, nullptr);
  ASSERT_EQ(candidates.size(), 1u);  // the others do not compare
  EXPECT_LT(ErrorOf(candidates[0].y_from_x), 0.03);
  EXPECT_EQ((*alignment)->y_from_x(), candidates[0].y_from_x);
}

TEST_F(CandidateChoiceTest, AFirstMapThatLooksUnlikeIsNotLeftInAHurry) {
  std::stop_source hurry;
  const StopTokens stops = {{}, hurry.get_token()};
  CandidateChoice choice(prepared_[kX], prepared_[kY], options_, stops);
  std::vector<Candidate> candidates = {Planted(Rough(loser_, 2), 0.001),
                                       Planted(Rough(winner_, 2), 0.1)};
  // During the rounds of the first one; the other one may be begun beside.
  const auto alignment =
      choice.Choose([&](double) { hurry.request_stop(); }, &candidates);
  ASSERT_THAT(alignment, IsOk());
  ASSERT_EQ(candidates.size(), 1u);
  EXPECT_LT(ErrorOf(candidates[0].y_from_x), 0.06);
}

TEST_F(CandidateChoiceTest, AVariantThatIsFarBehindIsGivenUp) {
  // One side of the body goes where the half turn sends it.
  VertexMap torn = winner_;
  const Positions& places = prepared_[kX].solved().mesh.positions;
  for (VertexIndex x = 0; x < places.rows(); ++x) {
    if (places(x, 0) < 0) torn[x] = loser_[x];
  }
  for (const Relation relation : {Relation::kWhole, Relation::kPartOfY}) {
    options_.relation = relation;
    std::vector<Candidate> candidates = {
        Planted(winner_, 0.1), Planted(torn, 0.001), Planted(loser_, 0.001)};
    Choose(&candidates);
    ASSERT_EQ(candidates.size(), 3u);
    EXPECT_LT(ErrorOf(candidates[0].y_from_x), 0.03);
    // The half turn stays to the end, however far behind it is.
    EXPECT_FALSE(candidates[1].is_lost);
    EXPECT_GT(ErrorOf(candidates[1].y_from_x), 0.3);
    EXPECT_TRUE(candidates[2].is_lost);
    EXPECT_GE(candidates[2].scores.rank_value, candidates[1].scores.rank_value);
    EXPECT_GT(candidates[2].scores.normal_mismatch, 0);
    EXPECT_GT(candidates[2].scores.descriptor_mismatch, 0);
  }
}

TEST_F(CandidateChoiceTest, TheirOrderDecidesNothing) {
  std::vector<Candidate> one = {Planted(Rough(loser_, 2), 0.001),
                                Planted(Rough(winner_, 2), 0.1)};
  std::vector<Candidate> other = {one[1], one[0]};
  Choose(&one);
  Choose(&other);
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(one[i].y_from_x, other[i].y_from_x);
    EXPECT_EQ(one[i].scores.rank_value, other[i].scores.rank_value);
  }
}

TEST_F(CandidateChoiceTest, OneAndTheSameMapIsNoClearWinner) {
  std::vector<Candidate> candidates = {Planted(winner_, 0.001),
                                       Planted(winner_, 0.1)};
  Choose(&candidates);
  EXPECT_EQ(SymmetryConfidence(options_, candidates), 0);
}

/// What is seen of a body from one side, and all of it in another pose.
class ViewChoiceTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_FALSE(poses_.truth.empty());
    const Positions normals = VertexNormals(poses_.x);
    const DirtyMesh seen = WithoutLoneVertices(WithoutFaces(
        Untouched(poses_.x), [&](const TriangleMesh& mesh, VertexIndex f) {
          return normals(mesh.faces(f, 0), 2) < 0;
        }));
    options_.relation = Relation::kPartOfY;
    ProgressReporter silent({}, StagePlan(options_));
    ASSERT_THAT(PrepareMeshes({MeshToPrepare{Clean(seen.mesh), "mesh_x"},
                               MeshToPrepare{Clean(poses_.y), "mesh_y"}},
                              options_, &silent, {}, &prepared_),
                IsOk());
    const double share = SurfaceArea(seen.mesh) / SurfaceArea(poses_.x);
    ASSERT_THAT(Rescale(std::sqrt(share), options_, &prepared_[kX]), IsOk());
    for (const VertexIndex x : prepared_[kX].solved().user_from_working) {
      truth_.push_back(prepared_[kY]
                           .solved()
                           .working_from_user[poses_.truth[seen.origin[x]]]);
    }
  }

  /// The truth, all of it so many edges too far in one direction.
  VertexMap Drifted(int steps) const {
    const Positions& places = prepared_[kY].solved().mesh.positions;
    VertexMap map = truth_;
    for (VertexIndex& y : map) {
      for (int step = 0; step < steps; ++step) {
        const auto near = prepared_[kY].solved().stars.Neighbors(y);
        y = *absl::c_max_element(near, [&](VertexIndex a, VertexIndex b) {
          return places(a, 1) < places(b, 1);
        });
      }
    }
    return map;
  }

  /// What becomes of the map.
  Candidate Chosen(VertexMap y_from_x, bool is_mostly_rim) const {
    std::vector<Candidate> candidates(1);
    candidates[0].y_from_x = std::move(y_from_x);
    const StopTokens stops;
    CandidateChoice choice(prepared_[kX], prepared_[kY], options_, stops,
                           is_mostly_rim);
    EXPECT_THAT(choice.Choose([](double) {}, &candidates), IsOk());
    return std::move(candidates[0]);
  }

  /// `map`: a working one.
  double ErrorOf(const VertexMap& map) const {
    return GeodesicErrorMeter(prepared_[kY].solved().mesh)
        .Measure(map, truth_)
        ->mean_over_diameter;
  }

  MatchOptions options_;
  const TwoPoses poses_ = ReadTwoPoses(ISOMATCH_TEST_DATA);
  VertexMap truth_;  ///< working
  std::array<PreparedMesh, 2> prepared_;
};

// Its functions differ from those of the whole, and hold a map where it is.
TEST_F(ViewChoiceTest, EigenfunctionsCountLessWhereTheRimIsNear) {
  options_.wavelet_rounds = 0;  // which moves it, too
  const VertexMap drifted = Drifted(2);
  EXPECT_LT(ErrorOf(Chosen(drifted, true).y_from_x),
            0.75 * ErrorOf(Chosen(drifted, false).y_from_x));
}

TEST_F(ViewChoiceTest, AWaveletFilterFindsTheMapBehindARoughOne) {
  const VertexMap rough =
      WalkedAtRandom(truth_, 6, prepared_[kY].solved().stars);
  const Candidate candidate = Chosen(rough, /*is_mostly_rim=*/true);
  EXPECT_LT(ErrorOf(candidate.filtered), 0.8 * ErrorOf(rough));
}

}  // namespace
}  // namespace isomatch
