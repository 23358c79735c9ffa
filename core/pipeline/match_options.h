#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "core/matching/first_stage.h"

namespace isomatch {

/// A named set of options.
enum class Profile {
  /// What measured best; see core/EXPERIMENTS.md.
  kDefault,
  /// Every step as the paper gives it.
  kPaper,
};

/// What of each shape has a counterpart on the other. The values go to disk and
/// never change.
enum class Relation {
  /// All of both.
  kWhole = 1,
  /// All of X, a part of Y.
  kPartOfY = 2,
  /// A part of X, all of Y.
  kPartOfX = 3,
  /// A part of each.
  kOverlap = 4,
  /// To be found out: one of the others.
  kAuto = 5,
};

/// All there are, as users are told of them.
inline constexpr std::array kRelations = {Relation::kWhole, Relation::kPartOfY,
                                          Relation::kPartOfX,
                                          Relation::kOverlap, Relation::kAuto};

/// What is known of the two meshes' units.
enum class LengthScale {
  /// Nothing. Whole shapes are taken to have the same area; of a part it is
  /// found out.
  kAuto,
  /// They are the same.
  kSame,
};

inline constexpr std::array kLengthScales = {LengthScale::kAuto,
                                             LengthScale::kSame};

/// Every constant of the method. Lengths are fractions of sqrt(surface area),
/// so that results do not depend on a file's unit.
struct MatchOptions {
  // What changes the result.

  Profile profile = Profile::kDefault;
  /// Not in the paper.
  Relation relation = Relation::kWhole;
  /// kAuto of whole shapes, kSame of overlaps. Where the relation is found out,
  /// an overlap is taken to be in one unit. Not in the paper.
  LengthScale scale = LengthScale::kAuto;
  /// A part of unknown scale is taken to have not the likeliest scale but the
  /// next one; FAILED_PRECONDITION where no other is likely.
  bool next_scale = false;
  /// Same input, options and random seed give the same result.
  std::uint64_t random_seed = 1;

  /// Eq. 5: closeness = exp(-d / (kernel_width sqrt(area))). In (0, 10]. The
  /// paper writes exp(-d) and leaves the unit open.
  double kernel_width = 0.1;
  /// 3.1: vertices that take part in seeds and first-stage insertion: this many
  /// farthest points, 16 to 4000, or all vertices when 0.
  int pool_size = 1000;

  /// Meshes of more vertices than this (and a tenth) are decimated to about as
  /// many; the map is found there and lifted to all vertices. 500 to 10^9, or 0
  /// for never. Not in the paper.
  int solved_vertices = 4000;

  /// Large components are paired by size and shape and matched one by one.
  /// Otherwise all that is known of them grows together. Not in the paper.
  bool match_components = true;

  /// 3.5: m farthest points a side, k matches a seed; 1 <= k <= m <= 8, k <= 4.
  int seed_points = 6;
  int seed_matches = 3;
  /// Seeds that start growing, best pairwise distances first; 0 for all.
  int max_seeds = 1500;
  /// How many competing maps survive, by increasing `matches`, those that have
  /// become the same counted once; the last round keeps one, at
  /// `first_stage_matches`.
  std::vector<SelectionRound> selection_rounds = {
      {12, 250}, {40, 60}, {80, 12}};
  Selection selection = Selection::kEmbeddingError;
  /// Competing maps with a negative orientation score come last from this many
  /// matches on; 0 switches the cue off. Not in the paper.
  int orientation_from = 40;
  /// Regions of complete competing maps that are mirrored although the map is
  /// not are taken out and grown anew from their rim. Not in the paper.
  bool regrow_mirrored = true;
  /// Complete competing maps rank by their embedding error times this power of
  /// their curvature mismatch, and distinct ones in the end by twice the power;
  /// 0 leaves curvature out. In [0, 10]. Not in the paper.
  double curvature_weight = 1;
  /// Radius of the features that curvature speaks of. In [0.001, 1].
  double curvature_radius = 0.03;

  /// Distinct maps of the first stage that go on until the elastic alignment
  /// decides between them; 1 to 8. Needs alignment_rounds > 0. Not in the
  /// paper.
  int candidates = 4;
  /// A distinct map goes on if its rank value (embedding error, times curvature
  /// mismatch) is at most this many times the best one's. At least 1.
  double candidate_margin = 1.6;

  /// 3.3.1: matches after the first stage. At least 4.
  int first_stage_matches = 120;
  /// 3.3.1: candidates are the environments of the 3 best basis points; false
  /// compares all unmatched points of the pool.
  bool candidates_from_environments = false;

  /// 3.4.
  Swapping swapping = Swapping::kAnnealed;
  /// 3.4: a phase of proposals after this many insertions.
  int swap_interval = 10;
  /// 3.4: proposals a phase.
  int swap_proposals = 500;
  /// Eq. 3, in units of Eq. 8 summed over ordered pairs. 0 or more.
  double temperature = 0.005;
  /// Matches among which a swap partner is drawn: the nearest ones, or any
  /// when 0 (as the paper has it).
  int swap_neighbors = 16;
  /// After each phase: each match may move its image to one of this many
  /// nearest unmatched points if Eq. 8 falls. 0 for none (paper).
  int relocation_neighbors = 16;

  /// 3.3.2: fraction of vertices matched by second-stage insertion; 0 leaves
  /// the second stage and the final phase out.
  double second_stage_fraction = 0;
  /// 3.4: fraction of worst contributors (Eq. 9) swapped at temperature 0.
  double final_swap_fraction = 0.2;
  /// Dense map by nearest neighbors in closeness space of all sparse matches.
  bool dense_from_closeness = true;

  /// ZoomOut: sizes of the spectral bases. zoomout_end 0 leaves it out.
  int zoomout_start = 20;
  int zoomout_end = 0;
  int zoomout_step = 5;

  /// Refinement of the dense map in place of ZoomOut; not in the paper. The
  /// radius of descriptors (core/descriptor/shot_descriptor.h) by which better
  /// images are looked for nearby, at least three mean edges of the coarser
  /// mesh, 0 to leave them out, in [0, 1]; rounds of
  /// wavelet filtering (core/spectral/wavelet_filter.h) before the elastic
  /// alignment, and rounds of that (core/alignment/elastic_alignment.h) at
  /// stiffness falling from first to last, where X is a part of Y to 0.3 times
  /// that. alignment_rounds 0 leaves all of it out; it excludes ZoomOut.
  double descriptor_radius = 0.08;
  int wavelet_rounds = 2;
  int alignment_rounds = 16;
  int alignment_basis = 128;
  double alignment_stiffness_first = 0.03;
  double alignment_stiffness_last = 0.001;

  /// Landmarks are kept whatever contradicts them. Otherwise those that the
  /// rest of the map contradicts are left out and reported.
  bool landmarks_exact = false;

  // What changes only cost or reporting.

  /// Fills Correspondence::functional_map.
  bool keep_functional_map = false;

  /// Threads; 0 means one for each core.
  int threads = 0;
  /// Match takes at most this many bytes beyond the two meshes, as far as
  /// EstimateMemoryBytes holds: it uses fewer threads, then solves on fewer
  /// vertices (PlanWithinMemory), which changes the result and is a warning in
  /// it, or refuses. 0 for no limit. MatchPrepared takes shapes as they are and
  /// refuses those that could not be decimated and do not fit.
  std::int64_t memory_limit_bytes = 0;
  /// Keeps the map after each stage in Correspondence::stage_maps.
  bool keep_stage_maps = false;

  /// Returns the options of a profile.
  static MatchOptions ForProfile(Profile profile);

  /// INVALID_ARGUMENT naming field, value and allowed range.
  absl::Status Validate() const;

  /// Whether what is not found for sure may be looked for again: with other
  /// random seeds, a part of unknown scale at the next likely one.
  bool IsTriedAgain() const;
};

/// "whole", "part-of-y", "part-of-x" or "overlap".
const char* RelationName(Relation relation);
/// "auto" or "same".
const char* LengthScaleName(LengthScale scale);

/// Those of kRelations and of kLengthScales.
std::vector<std::string> RelationNames();
std::vector<std::string> LengthScaleNames();

/// What has that name; nullopt when nothing has.
std::optional<Relation> RelationOf(absl::string_view name);
std::optional<LengthScale> LengthScaleOf(absl::string_view name);

/// "default" or "paper".
const char* ProfileName(Profile profile);

}  // namespace isomatch
