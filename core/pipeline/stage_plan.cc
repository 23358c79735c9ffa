#include "core/pipeline/stage_plan.h"

#include <algorithm>

namespace isomatch {

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
  std::vector<std::pair<Stage, double>> plan = {{Stage::kPrepare, 0.03},
                                                {Stage::kGeodesics, 0.2}};
  if (SpectralCount(options) > 0) plan.emplace_back(Stage::kSpectral, 0.25);
  plan.emplace_back(Stage::kSeeds, 0.02);
  plan.emplace_back(Stage::kFirstInsertion, 0.3);
  if (options.second_stage_fraction > 0) {
    plan.emplace_back(Stage::kSecondInsertion, 0.3);
    plan.emplace_back(Stage::kFinalSwapping, 0.2);
  }
  if (options.dense_from_closeness) plan.emplace_back(Stage::kDense, 0.15);
  if (options.zoomout_end > 0) plan.emplace_back(Stage::kZoomOut, 0.2);
  if (options.alignment_rounds > 0) {
    plan.emplace_back(Stage::kChoice, 0.25);
    plan.emplace_back(Stage::kAlignment, 0.25);
  }
  plan.emplace_back(Stage::kQuality, 0.05);
  return plan;
}

}  // namespace isomatch
