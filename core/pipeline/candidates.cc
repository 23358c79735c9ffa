#include "core/pipeline/candidates.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/base/status_macros.h"
#include "core/spectral/functional_map.h"
#include "core/spectral/wavelet_filter.h"

namespace isomatch {
namespace {

/// Rounds of the coarse alignment by which distinct maps are judged.
constexpr int kCoarseRounds = 4;
/// Rounds between two stiffnesses of the alignment.
constexpr int kRoundsPerStiffness = 3;
/// Scales of the wavelet filter.
constexpr int kWaveletScales = 6;
/// Below these, factors of the rank value are rounding.
constexpr double kPerfectRank = 1e-8;
constexpr double kPerfectFit = 1e-4;

absl::Status FilterWavelets(const AlignmentShape& shape_x,
                            const AlignmentShape& shape_y,
                            const MatchOptions& options,
                            const std::stop_token& stop, VertexMap* y_from_x) {
  const SpectralBasis& x = shape_x.spectral;
  const SpectralBasis& y = shape_y.spectral;
  const int k = std::min({options.alignment_basis, x.size(), y.size()});
  const Eigen::MatrixXd filter = WaveletFilter(
      x.eigenvalues.head(k), y.eigenvalues.head(k), kWaveletScales);
  for (int round = 0; round < options.wavelet_rounds; ++round) {
    const Eigen::MatrixXd fmap_x_from_y =
        FunctionalMapFromVertexMap(x, y, *y_from_x, k).cwiseProduct(filter);
    ISOMATCH_ASSIGN_OR_RETURN(
        *y_from_x, VertexMapFromFunctionalMap(x, y, fmap_x_from_y, stop));
  }
  return absl::OkStatus();
}

void Judge(const ElasticAlignment& alignment, bool oriented,
           MapScores* scores) {
  const AlignmentScore score = alignment.Score();
  scores->normal_mismatch = oriented ? score.normal_mismatch : 0;
  scores->stretch = score.stretch;
  const double shown = oriented ? score.normal_mismatch : score.stretch;
  scores->rank_value =
      std::max(scores->rank_value, kPerfectRank) * std::max(shown, kPerfectFit);
}

}  // namespace

FirstStageOptions FirstStageOptionsOf(const MatchOptions& options,
                                      std::size_t num_landmarks) {
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
  first.max_results = options.alignment_rounds > 0 ? options.candidates : 1;
  first.random_seed = options.random_seed;
  return first;
}

absl::StatusOr<std::unique_ptr<ElasticAlignment>> ChooseByAlignment(
    const AlignmentShape& shape_x, const AlignmentShape& shape_y, bool oriented,
    const MatchOptions& options, const std::function<void(double)>& progress,
    const std::stop_token& stop, std::vector<Candidate>* candidates) {
  AlignmentOptions alignment_options;
  alignment_options.basis = options.alignment_basis;
  if (!oriented) alignment_options.normal_weight = 0;
  std::unique_ptr<ElasticAlignment> best;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < candidates->size(); ++i) {
    Candidate& candidate = (*candidates)[i];
    ISOMATCH_RETURN_IF_ERROR(
        FilterWavelets(shape_x, shape_y, options, stop, &candidate.y_from_x));
    auto alignment = std::make_unique<ElasticAlignment>(
        shape_x, shape_y, alignment_options, candidate.y_from_x);
    ISOMATCH_RETURN_IF_ERROR(
        alignment->Run(options.alignment_stiffness_first, kCoarseRounds, stop));
    candidate.y_from_x = alignment->y_from_x();
    Judge(*alignment, oriented, &candidate.scores);
    if (candidate.scores.rank_value < least) {
      least = candidate.scores.rank_value;
      best = std::move(alignment);
    }
    progress(double(i + 1) / static_cast<double>(candidates->size()));
  }
  std::stable_sort(candidates->begin(), candidates->end(),
                   [](const Candidate& a, const Candidate& b) {
                     return a.scores.rank_value < b.scores.rank_value;
                   });
  return best;
}

absl::Status FinishAlignment(const MatchOptions& options,
                             const std::function<void(double)>& progress,
                             const std::stop_token& stop,
                             ElasticAlignment* alignment) {
  const double fall =
      options.alignment_stiffness_last / options.alignment_stiffness_first;
  const int last = options.alignment_rounds - kRoundsPerStiffness;
  for (int done = 0; done < options.alignment_rounds;) {
    const double part = last > 0 ? std::min(1.0, double(done) / last) : 1;
    const int rounds =
        std::min(kRoundsPerStiffness, options.alignment_rounds - done);
    ISOMATCH_RETURN_IF_ERROR(
        alignment->Run(options.alignment_stiffness_first * std::pow(fall, part),
                       rounds, stop));
    done += rounds;
    progress(double(done) / options.alignment_rounds);
  }
  return absl::OkStatus();
}

double SymmetryConfidence(const MatchOptions& options,
                          const std::vector<Candidate>& candidates) {
  if (options.candidates == 1 || options.alignment_rounds == 0) return 0;
  if (candidates.size() < 2) return 1;
  const double ratio =
      candidates[0].scores.rank_value / candidates[1].scores.rank_value;
  return 1 - ratio * ratio;
}

}  // namespace isomatch
