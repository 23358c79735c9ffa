#pragma once

#include <array>

#include "core/geodesic/basis_points.h"
#include "core/matching/matching.h"

namespace isomatch {

/// Where first-stage insertion looks for a partner (paper, Section 3.3.1,
/// steps 2 and 3) on one shape.
class CandidateSearch {
 public:
  /// Basis points whose environments are searched.
  static constexpr int kBestBasisPoints = 3;

  /// Every unmatched point of the pool is a candidate.
  CandidateSearch() = default;
  /// Candidates lie in the environments of the best basis points.
  CandidateSearch(const BasisPoints& basis, const PointPool& pool);

  /// Returns the unmatched point of the other side of `from` that minimizes
  /// Eq. 8 for `point` of `from`, ties by smallest index; -1 when all points
  /// there are matched.
  int Best(const Matching& matching, Side from, int point) const;

 private:
  int BestOverall(const Matching& matching, Side from, int point) const;
  std::vector<int> NearBestBasisPoints(const Matching& matching, Side from,
                                       int point) const;

  std::vector<int> basis_points_;  ///< of each environment, as pool points
  std::vector<std::vector<int>> environments_;
};

/// First-stage insertion of one match: the farthest unmatched point of `from`
/// and its best partner on the other side. False, and no change, when either
/// side is used up.
bool InsertFrom(Side from, const CandidateSearch& search_other_side,
                Matching* matching);

}  // namespace isomatch
