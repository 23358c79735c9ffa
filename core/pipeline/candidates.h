#pragma once

#include <functional>
#include <memory>
#include <stop_token>
#include <vector>

#include "absl/status/statusor.h"
#include "core/alignment/elastic_alignment.h"
#include "core/base/vertex_index.h"
#include "core/matching/first_stage.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/matcher.h"

namespace isomatch {

/// A whole map that may be the result, as it grows. On working vertices.
struct Candidate {
  std::vector<VertexMatch> sparse;
  VertexMap y_from_x;
  MapScores scores;
  double objective = 0;  ///< Eq. 4
};

/// What the options say of the first stage, with this many landmarks.
FirstStageOptions FirstStageOptionsOf(const MatchOptions& options,
                                      std::size_t num_landmarks);

/// Refines every candidate's dense map by wavelet filtering and lays it out by
/// a coarse elastic alignment; completes the scores, whose rank value is that
/// of the first stage times the mismatch of normals (the stretch where surfaces
/// are not `oriented`); sorts by it and returns the alignment of the best.
///
/// REQUIRES: at least one candidate, all dense. Errors as ElasticAlignment.
absl::StatusOr<std::unique_ptr<ElasticAlignment>> ChooseByAlignment(
    const AlignmentShape& shape_x, const AlignmentShape& shape_y, bool oriented,
    const MatchOptions& options, const std::function<void(double)>& progress,
    const std::stop_token& stop, std::vector<Candidate>* candidates);

/// The rounds of options.alignment_rounds, at falling stiffness.
absl::Status FinishAlignment(const MatchOptions& options,
                             const std::function<void(double)>& progress,
                             const std::stop_token& stop,
                             ElasticAlignment* alignment);

/// 1 - (rank value of the best / of the next)^2; 1 without a next, 0 when
/// nothing was compared. REQUIRES: sorted.
double SymmetryConfidence(const MatchOptions& options,
                          const std::vector<Candidate>& candidates);

}  // namespace isomatch
