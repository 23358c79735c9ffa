#include "core/matching/insertion.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

namespace isomatch {
namespace {

/// Position of the smallest error, ties by smallest point.
int ArgMin(const std::vector<int>& points, const std::vector<float>& errors) {
  int best = -1;
  float least = std::numeric_limits<float>::infinity();
  for (std::size_t c = 0; c < points.size(); ++c) {
    if (errors[c] > least || (errors[c] == least && points[c] > best)) continue;
    least = errors[c];
    best = points[c];
  }
  return best;
}

}  // namespace

CandidateSearch::CandidateSearch(const BasisPoints& basis,
                                 const PointPool& pool) {
  std::vector<int> point_of_vertex(basis.num_vertices(), -1);
  for (int p = 0; p < pool.size(); ++p) point_of_vertex[pool.vertex(p)] = p;
  const Environments environments = EnvironmentsOf(basis, pool.vertices());
  for (int z = 0; z < basis.num_points(); ++z) {
    const int point = point_of_vertex[basis.points()[z]];
    if (point < 0) continue;  // a pool smaller than the basis
    const auto members = environments[z];
    basis_points_.push_back(point);
    environments_.emplace_back(members.begin(), members.end());
  }
}

int CandidateSearch::Best(const Matching& matching, Side from,
                          int point) const {
  if (environments_.empty()) return BestOverall(matching, from, point);
  const std::vector<int> candidates =
      NearBestBasisPoints(matching, from, point);
  if (candidates.empty()) return BestOverall(matching, from, point);
  std::vector<float> errors;
  matching.EmbeddingErrors(from, point, candidates, &errors);
  return ArgMin(candidates, errors);
}

int CandidateSearch::BestOverall(const Matching& matching, Side from,
                                 int point) const {
  std::vector<float> errors;
  matching.EmbeddingErrors(from, point, &errors);
  return matching.LeastUnmatched(
      Other(from),
      Eigen::Map<const Eigen::ArrayXf>(
          errors.data(), static_cast<Eigen::Index>(errors.size())));
}

std::vector<int> CandidateSearch::NearBestBasisPoints(const Matching& matching,
                                                      Side from,
                                                      int point) const {
  std::vector<float> errors;
  matching.EmbeddingErrors(from, point, basis_points_, &errors);
  std::vector<int> order(basis_points_.size());
  std::iota(order.begin(), order.end(), 0);
  const auto best_end =
      order.begin() + std::min<std::size_t>(kBestBasisPoints, order.size());
  std::partial_sort(order.begin(), best_end, order.end(), [&](int a, int b) {
    return std::pair(errors[a], a) < std::pair(errors[b], b);
  });
  std::vector<int> candidates;
  for (auto z = order.begin(); z != best_end; ++z) {
    for (const int candidate : environments_[*z]) {
      if (!matching.is_matched(Other(from), candidate)) {
        candidates.push_back(candidate);
      }
    }
  }
  std::sort(candidates.begin(), candidates.end());
  candidates.erase(std::unique(candidates.begin(), candidates.end()),
                   candidates.end());
  return candidates;
}

bool InsertFrom(Side from, const CandidateSearch& search_other_side,
                Matching* matching) {
  const int point = matching->FarthestUnmatched(from);
  if (point < 0) return false;
  const int partner = search_other_side.Best(*matching, from, point);
  if (partner < 0) return false;
  matching->Add(from == kX ? PointMatch{point, partner}
                           : PointMatch{partner, point});
  return true;
}

}  // namespace isomatch
