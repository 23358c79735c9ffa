#pragma once

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

  /// What LeaveOutContradicting and Misfit need first, to be called once.
  /// CANCELLED after the token given.
  absl::Status SolveSources();

  /// At first: those near enough to a match to be told by it. One entry a
  /// vertex of X, 1 or 0.
  std::vector<char> NearMatches(absl::Span<const VertexMatch> matches) const;

  /// Once it is laid on Y: those nearer to it than `tolerance` (sqrt(area))
  /// that face as it does there and do not lie beyond its rim; of several far
  /// apart in one place the one that fits best.
  std::vector<char> Matched(const ElasticAlignment& alignment,
                            double tolerance) const;

  /// Leaves out of `matched` what does not keep its distances from most of the
  /// rest, as where a limb lies on another one: X and Y are surfaces that bend,
  /// but distances along them stay. What does not keep them itself is not asked
  /// about others. CANCELLED after the token given first.
  absl::Status LeaveOutContradicting(const ElasticAlignment& alignment,
                                     std::vector<char>* matched) const;

  /// At last: what is matched in specks of X, amid what is left out, is left
  /// out too; what is left out where Y goes on, as the images around it are not
  /// at Y's rim, is matched, unless it is large.
  void Smooth(const ElasticAlignment& alignment,
              std::vector<char>* matched) const;

  /// Of alignment.matched(), which is not empty. CANCELLED after the token
  /// given first.
  absl::StatusOr<OverlapMisfit> Misfit(const ElasticAlignment& alignment) const;

 private:
  /// Distances of all vertices from some that are matched.
  struct ComparedFields {
    std::vector<int> sources;  ///< those of from_x_ that are matched
    BasisPoints from_images;   ///< on Y, in the same order
  };

  absl::StatusOr<ComparedFields> FieldsOf(
      const VertexMap& y_from_x, const std::vector<char>& matched) const;
  void KeepOneEach(const ElasticAlignment& alignment,
                   std::vector<char>* matched) const;
  double OpenBorder(const ElasticAlignment& alignment) const;
  /// Connected vertices of X that are all matched, or all left out.
  struct Region {
    double area = 0;
    int edges = 0;   ///< to vertices of the other kind
    int at_rim = 0;  ///< of those where the matched end lies at Y's rim
  };
  struct Regions {
    VertexMap first_of;            ///< the first vertex of the region of each
    std::vector<Region> by_first;  ///< one entry a vertex
    const Region& Of(VertexIndex x) const { return by_first[first_of[x]]; }
  };
  Regions RegionsOf(const VertexMap& y_from_x,
                    const std::vector<char>& matched) const;

  const PreparedMesh& x_;
  const WorkingMesh& solved_x_;
  const WorkingMesh& solved_y_;
  const std::stop_token stop_;
  const DistanceFieldSolver solver_x_;
  const DistanceFieldSolver solver_y_;
  const std::vector<float> rim_distances_x_;
  const std::vector<float> rim_distances_y_;
  BasisPoints from_x_;  ///< of SolveSources
};

}  // namespace isomatch
