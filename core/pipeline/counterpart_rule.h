#pragma once

#include <optional>
#include <stop_token>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "core/alignment/elastic_alignment.h"
#include "core/base/vertex_index.h"
#include "core/geodesic/basis_points.h"
#include "core/geodesic/distance_field_solver.h"
#include "core/pipeline/prepared_mesh.h"

namespace isomatch {

/// What speaks against a map between parts, where it matches vertices.
struct OverlapMisfit {
  /// Mean |d_X - d_Y| over pairs of matched vertices, sqrt(area).
  double distortion = 0;
  /// Length of the border between vertices with and without a counterpart that
  /// lies neither at X's rim nor at Y's, sqrt(area): there the map ends
  /// although both shapes go on.
  double open_border = 0;
};

/// Tells which vertices of X have a counterpart on Y, where either may lack
/// what the other has, from how X lies on Y. References must outlive it. Not in
/// the paper.
class CounterpartRule {
 public:
  CounterpartRule(const PreparedMesh& x, const PreparedMesh& y,
                  const std::stop_token& stop);

  /// At first: those near enough to a match to be told by it. One entry a
  /// vertex of X, 1 or 0.
  std::vector<char> NearMatches(absl::Span<const VertexMatch> matches) const;

  /// Once it is laid on Y: those nearer to it than `tolerance` (sqrt(area))
  /// that face as it does there and do not lie beyond its rim; of several far
  /// apart in one place the one that fits best.
  std::vector<char> Matched(const ElasticAlignment& alignment,
                            double tolerance) const;

  /// Of alignment.matched(), which is not empty. CANCELLED after the token
  /// given first.
  absl::StatusOr<OverlapMisfit> Misfit(const ElasticAlignment& alignment);

 private:
  void KeepOneEach(const ElasticAlignment& alignment,
                   std::vector<char>* matched) const;
  double OpenBorder(const ElasticAlignment& alignment) const;

  const PreparedMesh& x_;
  const WorkingMesh& solved_x_;
  const WorkingMesh& solved_y_;
  const std::stop_token stop_;
  const DistanceFieldSolver solver_x_;
  const DistanceFieldSolver solver_y_;
  const std::vector<float> rim_distances_x_;
  const std::vector<float> rim_distances_y_;
  std::optional<BasisPoints> from_x_;  ///< of Misfit, once needed
};

}  // namespace isomatch
