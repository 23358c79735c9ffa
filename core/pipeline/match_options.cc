#include "core/pipeline/match_options.h"

#include <cstdint>
#include <limits>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

template <typename T>
absl::Status InRange(const char* field, T value, T low, T high) {
  if (value >= low && value <= high) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "options.", field, ": ", value, ", expected ", low, " to ", high));
}

absl::Status ValidateRounds(const MatchOptions& options) {
  int matches = options.seed_matches;
  for (const SelectionRound& round : options.selection_rounds) {
    if (round.matches <= matches || round.keep < 1) {
      return absl::InvalidArgumentError(absl::StrCat(
          "options.selection_rounds: {", round.matches, ", ", round.keep,
          "}, expected more than ", matches, " matches and at least 1 kept"));
    }
    matches = round.matches;
  }
  return absl::OkStatus();
}

absl::Status ValidateFirstStage(const MatchOptions& o) {
  constexpr int kMany = 1'000'000;
  ISOMATCH_RETURN_IF_ERROR(InRange("kernel_width", o.kernel_width, 1e-3, 10.0));
  if (o.pool_size != 0) {
    ISOMATCH_RETURN_IF_ERROR(InRange("pool_size", o.pool_size, 16, 4000));
  }
  if (o.solved_vertices != 0) {
    ISOMATCH_RETURN_IF_ERROR(
        InRange("solved_vertices", o.solved_vertices, 500, 1'000'000'000));
  }
  ISOMATCH_RETURN_IF_ERROR(InRange("seed_points", o.seed_points, 1, 8));
  ISOMATCH_RETURN_IF_ERROR(InRange("seed_matches", o.seed_matches, 1, 4));
  if (o.seed_matches > o.seed_points) {
    return absl::InvalidArgumentError(
        absl::StrCat("options.seed_matches: ", o.seed_matches,
                     ", expected at most seed_points, ", o.seed_points));
  }
  ISOMATCH_RETURN_IF_ERROR(InRange("max_seeds", o.max_seeds, 0, kMany));
  ISOMATCH_RETURN_IF_ERROR(
      InRange("orientation_from", o.orientation_from, 0, kMany));
  ISOMATCH_RETURN_IF_ERROR(
      InRange("curvature_weight", o.curvature_weight, 0.0, 10.0));
  ISOMATCH_RETURN_IF_ERROR(
      InRange("curvature_radius", o.curvature_radius, 1e-3, 1.0));
  ISOMATCH_RETURN_IF_ERROR(
      InRange("first_stage_matches", o.first_stage_matches, 4, 1000));
  ISOMATCH_RETURN_IF_ERROR(InRange("swap_interval", o.swap_interval, 1, kMany));
  ISOMATCH_RETURN_IF_ERROR(
      InRange("swap_proposals", o.swap_proposals, 0, kMany));
  ISOMATCH_RETURN_IF_ERROR(InRange("temperature", o.temperature, 0.0, 1e6));
  ISOMATCH_RETURN_IF_ERROR(
      InRange("swap_neighbors", o.swap_neighbors, 0, 1000));
  ISOMATCH_RETURN_IF_ERROR(
      InRange("relocation_neighbors", o.relocation_neighbors, 0, 1000));
  return ValidateRounds(o);
}

absl::Status ValidateAlignment(const MatchOptions& o) {
  ISOMATCH_RETURN_IF_ERROR(InRange("candidates", o.candidates, 1, 8));
  ISOMATCH_RETURN_IF_ERROR(
      InRange("candidate_margin", o.candidate_margin, 1.0, 1e6));
  ISOMATCH_RETURN_IF_ERROR(
      InRange("descriptor_radius", o.descriptor_radius, 0.0, 1.0));
  ISOMATCH_RETURN_IF_ERROR(InRange("wavelet_rounds", o.wavelet_rounds, 0, 100));
  ISOMATCH_RETURN_IF_ERROR(
      InRange("alignment_rounds", o.alignment_rounds, 0, 1000));
  ISOMATCH_RETURN_IF_ERROR(
      InRange("alignment_basis", o.alignment_basis, 1, 500));
  ISOMATCH_RETURN_IF_ERROR(InRange("alignment_stiffness_first",
                                   o.alignment_stiffness_first, 1e-6, 1e3));
  ISOMATCH_RETURN_IF_ERROR(InRange("alignment_stiffness_last",
                                   o.alignment_stiffness_last, 1e-6, 1e3));
  if (o.alignment_rounds > 0 && o.zoomout_end > 0) {
    return absl::InvalidArgumentError(absl::StrCat(
        "options.zoomout_end: ", o.zoomout_end,
        ", expected 0 together with alignment_rounds ", o.alignment_rounds));
  }
  if (o.alignment_rounds > 0 && !o.dense_from_closeness) {
    return absl::InvalidArgumentError(
        "options.dense_from_closeness: false, expected true with "
        "alignment_rounds above 0, which start from a dense map");
  }
  return absl::OkStatus();
}

absl::Status ValidateRelation(const MatchOptions& o) {
  if (o.relation == Relation::kWhole) {
    if (o.scale == LengthScale::kAuto) return absl::OkStatus();
    return absl::InvalidArgumentError(absl::StrCat(
        "options.scale: ", LengthScaleName(o.scale),
        ", expected auto with relation whole, which takes both areas for "
        "equal"));
  }
  if (o.relation == Relation::kOverlap && o.scale == LengthScale::kAuto) {
    return absl::InvalidArgumentError(
        "options.scale: auto, expected same with relation overlap: what two "
        "parts have in common does not tell their unit");
  }
  if (o.alignment_rounds > 0 && o.pool_size > 0 &&
      !o.candidates_from_environments &&
      o.selection == Selection::kEmbeddingError) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("options.relation: ", RelationName(o.relation),
                   ", expected whole with the steps of profile paper"));
}

template <typename Values, typename Value>
std::vector<std::string> NamesOf(const Values& values,
                                 const char* (*name_of)(Value)) {
  std::vector<std::string> names;
  names.reserve(values.size());
  for (const Value value : values) names.emplace_back(name_of(value));
  return names;
}

template <typename Values, typename Value>
std::optional<Value> Named(absl::string_view name, const Values& values,
                           const char* (*name_of)(Value)) {
  for (const Value value : values) {
    if (name == name_of(value)) return value;
  }
  return std::nullopt;
}

}  // namespace

MatchOptions MatchOptions::ForProfile(Profile profile) {
  MatchOptions options;
  options.profile = profile;
  if (profile == Profile::kDefault) return options;
  options.pool_size = 0;
  options.solved_vertices = 0;
  options.match_components = false;
  options.seed_points = 4;
  options.seed_matches = 3;
  options.max_seeds = 0;
  options.selection_rounds.clear();
  options.selection = Selection::kObjective;
  options.orientation_from = 0;
  options.regrow_mirrored = false;
  options.curvature_weight = 0;
  options.first_stage_matches = 250;
  options.candidates_from_environments = true;
  options.swap_proposals = 2500;
  options.temperature = 0.01;
  options.swap_neighbors = 0;
  options.relocation_neighbors = 0;
  options.second_stage_fraction = 0.7;
  options.dense_from_closeness = false;
  options.candidates = 1;
  options.alignment_rounds = 0;
  options.zoomout_end = 120;
  return options;
}

absl::Status MatchOptions::Validate() const {
  ISOMATCH_RETURN_IF_ERROR(ValidateFirstStage(*this));
  ISOMATCH_RETURN_IF_ERROR(ValidateAlignment(*this));
  ISOMATCH_RETURN_IF_ERROR(ValidateRelation(*this));
  ISOMATCH_RETURN_IF_ERROR(
      InRange("second_stage_fraction", second_stage_fraction, 0.0, 1.0));
  ISOMATCH_RETURN_IF_ERROR(
      InRange("final_swap_fraction", final_swap_fraction, 0.0, 1.0));
  ISOMATCH_RETURN_IF_ERROR(InRange("zoomout_end", zoomout_end, 0, 500));
  if (zoomout_end > 0) {
    ISOMATCH_RETURN_IF_ERROR(
        InRange("zoomout_start", zoomout_start, 1, zoomout_end));
    ISOMATCH_RETURN_IF_ERROR(InRange("zoomout_step", zoomout_step, 1, 500));
  } else if (!dense_from_closeness) {
    return absl::InvalidArgumentError(
        "options.dense_from_closeness: false, expected true when zoomout_end "
        "is 0, since nothing else makes the map dense");
  }
  ISOMATCH_RETURN_IF_ERROR(InRange("memory_limit_bytes", memory_limit_bytes,
                                   std::int64_t{0},
                                   std::numeric_limits<std::int64_t>::max()));
  return InRange("threads", threads, 0, 1024);
}

bool MatchOptions::IsTriedAgain() const {
  return relation != Relation::kWhole && !next_scale;
}

const char* RelationName(Relation relation) {
  switch (relation) {
    case Relation::kWhole:
      break;
    case Relation::kPartOfY:
      return "part-of-y";
    case Relation::kPartOfX:
      return "part-of-x";
    case Relation::kOverlap:
      return "overlap";
    case Relation::kAuto:
      return "auto";
  }
  return "whole";
}

const char* LengthScaleName(LengthScale scale) {
  return scale == LengthScale::kSame ? "same" : "auto";
}

std::vector<std::string> RelationNames() {
  return NamesOf(kRelations, RelationName);
}

std::vector<std::string> LengthScaleNames() {
  return NamesOf(kLengthScales, LengthScaleName);
}

std::optional<Relation> RelationOf(absl::string_view name) {
  return Named(name, kRelations, RelationName);
}

std::optional<LengthScale> LengthScaleOf(absl::string_view name) {
  return Named(name, kLengthScales, LengthScaleName);
}

const char* ProfileName(Profile profile) {
  return profile == Profile::kPaper ? "paper" : "default";
}

}  // namespace isomatch
