#include "core/pipeline/match_options.h"

#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/matchers.h"

namespace isomatch {
namespace {

TEST(MatchOptionsTest, BothProfilesAreValid) {
  for (const Profile profile : {Profile::kDefault, Profile::kPaper}) {
    EXPECT_THAT(MatchOptions::ForProfile(profile).Validate(), IsOk());
    EXPECT_EQ(MatchOptions::ForProfile(profile).profile, profile);
  }
}

TEST(MatchOptionsTest, ThePaperProfileHasThePapersConstants) {
  const MatchOptions paper = MatchOptions::ForProfile(Profile::kPaper);
  EXPECT_EQ(paper.seed_points, 4);
  EXPECT_EQ(paper.seed_matches, 3);
  EXPECT_EQ(paper.first_stage_matches, 250);
  EXPECT_EQ(paper.swap_interval, 10);
  EXPECT_EQ(paper.swap_proposals, 2500);
  EXPECT_EQ(paper.temperature, 0.01);
  EXPECT_EQ(paper.second_stage_fraction, 0.7);
  EXPECT_EQ(paper.final_swap_fraction, 0.2);
  EXPECT_EQ(paper.selection, Selection::kObjective);
  EXPECT_TRUE(paper.candidates_from_environments);
  EXPECT_EQ(paper.relocation_neighbors, 0);
  EXPECT_EQ(paper.orientation_from, 0);
}

TEST(MatchOptionsTest, EveryWrongValueIsNamed) {
  const std::vector<std::pair<std::string, std::function<void(MatchOptions&)>>>
      cases = {
          {"kernel_width", [](MatchOptions& o) { o.kernel_width = 0; }},
          {"kernel_width", [](MatchOptions& o) { o.kernel_width = NAN; }},
          {"pool_size", [](MatchOptions& o) { o.pool_size = -1; }},
          {"pool_size", [](MatchOptions& o) { o.pool_size = 15; }},
          {"seed_points", [](MatchOptions& o) { o.seed_points = 9; }},
          {"seed_matches", [](MatchOptions& o) { o.seed_matches = 0; }},
          {"seed_matches", [](MatchOptions& o) { o.seed_points = 2; }},
          {"max_seeds", [](MatchOptions& o) { o.max_seeds = -5; }},
          {"selection_rounds",
           [](MatchOptions& o) {
             o.selection_rounds = {{40, 1}, {12, 1}};
           }},
          {"selection_rounds",
           [](MatchOptions& o) {
             o.selection_rounds = {{40, 0}};
           }},
          {"orientation_from",
           [](MatchOptions& o) { o.orientation_from = -1; }},
          {"curvature_weight",
           [](MatchOptions& o) { o.curvature_weight = -1; }},
          {"curvature_radius", [](MatchOptions& o) { o.curvature_radius = 0; }},
          {"first_stage_matches",
           [](MatchOptions& o) { o.first_stage_matches = 3; }},
          {"solved_vertices", [](MatchOptions& o) { o.solved_vertices = 499; }},
          {"memory_limit_bytes",
           [](MatchOptions& o) { o.memory_limit_bytes = -1; }},
          {"swap_interval", [](MatchOptions& o) { o.swap_interval = 0; }},
          {"swap_proposals", [](MatchOptions& o) { o.swap_proposals = -1; }},
          {"temperature", [](MatchOptions& o) { o.temperature = -0.1; }},
          {"swap_neighbors", [](MatchOptions& o) { o.swap_neighbors = -1; }},
          {"relocation_neighbors",
           [](MatchOptions& o) { o.relocation_neighbors = 5000; }},
          {"second_stage_fraction",
           [](MatchOptions& o) { o.second_stage_fraction = 1.5; }},
          {"final_swap_fraction",
           [](MatchOptions& o) { o.final_swap_fraction = -1; }},
          {"zoomout_end", [](MatchOptions& o) { o.zoomout_end = 501; }},
          {"zoomout_start",
           [](MatchOptions& o) {
             o.alignment_rounds = 0;
             o.zoomout_end = 120;
             o.zoomout_start = 121;
           }},
          {"zoomout_step",
           [](MatchOptions& o) {
             o.alignment_rounds = 0;
             o.zoomout_end = 120;
             o.zoomout_step = 0;
           }},
          {"zoomout_end", [](MatchOptions& o) { o.zoomout_end = 120; }},
          {"candidates", [](MatchOptions& o) { o.candidates = 0; }},
          {"candidate_margin",
           [](MatchOptions& o) { o.candidate_margin = 0.5; }},
          {"descriptor_radius",
           [](MatchOptions& o) { o.descriptor_radius = 1.5; }},
          {"wavelet_rounds", [](MatchOptions& o) { o.wavelet_rounds = -1; }},
          {"alignment_rounds",
           [](MatchOptions& o) { o.alignment_rounds = 2000; }},
          {"alignment_basis", [](MatchOptions& o) { o.alignment_basis = 0; }},
          {"alignment_stiffness_first",
           [](MatchOptions& o) { o.alignment_stiffness_first = 0; }},
          {"alignment_stiffness_last",
           [](MatchOptions& o) { o.alignment_stiffness_last = -1; }},
          {"dense_from_closeness",
           [](MatchOptions& o) { o.dense_from_closeness = false; }},
          {"dense_from_closeness",
           [](MatchOptions& o) {
             o.alignment_rounds = 0;
             o.dense_from_closeness = false;
           }},
          {"threads", [](MatchOptions& o) { o.threads = -2; }},
      };
  for (const auto& [field, spoil] : cases) {
    MatchOptions options;
    spoil(options);
    EXPECT_THAT(options.Validate(),
                StatusIs(absl::StatusCode::kInvalidArgument,
                         testing::AllOf(testing::HasSubstr("options." + field),
                                        testing::HasSubstr("expected"))));
  }
}

TEST(RelationTest, EachHasANameOfItsOwnThatLeadsBackToIt) {
  EXPECT_THAT(RelationNames(),
              testing::ElementsAre("whole", "part-of-y", "part-of-x", "overlap",
                                   "auto"));
  for (const Relation relation : kRelations) {
    EXPECT_EQ(RelationOf(RelationName(relation)), relation);
  }
  EXPECT_THAT(LengthScaleNames(), testing::ElementsAre("auto", "same"));
  for (const LengthScale scale : kLengthScales) {
    EXPECT_EQ(LengthScaleOf(LengthScaleName(scale)), scale);
  }
  for (const char* unknown : {"", "Whole", "part-of-z", "auto "}) {
    EXPECT_EQ(RelationOf(unknown), std::nullopt) << unknown;
    EXPECT_EQ(LengthScaleOf(unknown), std::nullopt) << unknown;
  }
}

}  // namespace
}  // namespace isomatch
