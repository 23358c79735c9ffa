#pragma once

#include <array>
#include <stop_token>
#include <vector>

#include "absl/status/status.h"
#include "absl/types/span.h"
#include "core/alignment/elastic_alignment.h"
#include "core/pipeline/candidate_choice.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/prepared_mesh.h"

namespace isomatch {

/// What a run found, on solved vertices: a map from the first shape to the
/// second, which are X and Y, or Y and X where Y is a part of X.
struct FoundCandidates {
  std::array<const PreparedMesh*, 2> shapes;
  /// The user's, from the first shape to the second.
  absl::Span<const Landmark> landmarks;
  const std::vector<Candidate>& candidates;  ///< best first
  ElasticAlignment* alignment;               ///< of the best, or nullptr
  const std::vector<float>& offsets;         ///< DescriptorOffsets of it
  /// The first shape's lengths times this are in the second one's unit.
  double scale = 1;
  const CounterpartRule* rule = nullptr;  ///< of overlaps
};

/// Fills the result with the map of all vertices of X and what is known of it:
/// lifted, in the user's numbering and direction, kNoVertex where `options`
/// leaves vertices without a counterpart. REQUIRES: the landmarks' outcomes are
/// in it. Errors as MeasureMap, LiftMap.
absl::Status Conclude(const FoundCandidates& found, const MatchOptions& options,
                      const std::stop_token& stop, Correspondence* result);

}  // namespace isomatch
