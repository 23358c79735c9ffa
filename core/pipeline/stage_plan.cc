#include "core/pipeline/stage_plan.h"

#include <algorithm>

namespace isomatch {
namespace {

/// Shares of stages that differ by what corresponds.
struct StageWork {
  double seeds = 0.02;
  double first_insertion = 0.3;
  double choice = 0.25;
};

/// Parts begin with seeds that are searched for, at many scales where the unit
/// is unknown.
StageWork WorkOf(const MatchOptions& options) {
  switch (options.relation) {
    case Relation::kPartOfY:
    case Relation::kPartOfX:
      return {options.scale == LengthScale::kAuto ? 5 : 0.9, 0.8, 0.7};
    case Relation::kOverlap:
      return {0.9, 0.8, 0.7};
    case Relation::kWhole:
    case Relation::kAuto:
      break;
  }
  return {};
}

}  // namespace

int SpectralCount(const MatchOptions& options) {
  return options.alignment_rounds > 0 ? options.alignment_basis
                                      : options.zoomout_end;
}

FirstStageOptions FirstStageOptionsOf(const MatchOptions& options,
                                      std::size_t num_landmarks) {
  /// Farthest points that tell places on Y apart.
  constexpr int kPlaces = 300;
  FirstStageOptions first;
  first.matches = std::max<int>(options.first_stage_matches, num_landmarks);
  first.rounds = options.selection_rounds;
  first.selection = options.selection;
  first.orientation_from = options.orientation_from;
  first.curvature_weight = options.curvature_weight;
  first.swapping = options.swapping;
  first.swap_interval = options.swap_interval;
  first.swaps = {options.swap_proposals, options.swap_neighbors};
  first.temperature = options.temperature;
  first.relocation_neighbors = options.relocation_neighbors;
  first.places = options.pool_size > 0 ? kPlaces : 0;
  first.max_results = options.alignment_rounds > 0 ? options.candidates : 1;
  first.insert_from_x_only = options.relation != Relation::kWhole;
  first.random_seed = options.random_seed;
  return first;
}

std::vector<std::pair<Stage, double>> StagePlan(const MatchOptions& options) {
  const StageWork work = WorkOf(options);
  std::vector<std::pair<Stage, double>> plan = {{Stage::kPrepare, 0.03},
                                                {Stage::kGeodesics, 0.2}};
  if (SpectralCount(options) > 0) plan.emplace_back(Stage::kSpectral, 0.25);
  plan.emplace_back(Stage::kSeeds, work.seeds);
  plan.emplace_back(Stage::kFirstInsertion, work.first_insertion);
  if (options.second_stage_fraction > 0) {
    plan.emplace_back(Stage::kSecondInsertion, 0.3);
    plan.emplace_back(Stage::kFinalSwapping, 0.2);
  }
  if (options.dense_from_closeness) plan.emplace_back(Stage::kDense, 0.15);
  if (options.zoomout_end > 0) plan.emplace_back(Stage::kZoomOut, 0.2);
  if (options.alignment_rounds > 0) {
    plan.emplace_back(Stage::kChoice, work.choice);
    plan.emplace_back(Stage::kAlignment, 0.25);
  }
  plan.emplace_back(Stage::kQuality, 0.05);
  return plan;
}

}  // namespace isomatch
