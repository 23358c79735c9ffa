#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/matching/closeness.h"

namespace isomatch {

/// Which of the two shapes.
enum Side { kX = 0, kY = 1 };
inline Side Other(Side side) { return side == kX ? kY : kX; }

/// One match between points of two pools.
struct PointMatch {
  int x;
  int y;
  bool operator==(const PointMatch&) const = default;
};

/// What speaks against matching single points, whatever else is matched.
struct PointCosts {
  /// P_Y x P_X, >= 0.
  const Eigen::MatrixXf& of_match;
  /// A cost of 1 at every match counts as so much embedding error.
  float weight = 0;
};

/// A partial injective map between two pools that grows match by match and can
/// be changed: the state of the first stage (paper, Section 3.2). Keeps the
/// closeness of every match to every other on both sides, so that a change is
/// judged in O(size) without touching geodesics.
///
/// Energy: Eq. 8 summed over all ordered pairs of matches,
///   E = sum_{i != j} |k_X(x_i, x_j) - k_Y(y_i, y_j)|,
///
/// and, with costs of single matches, (size - 1) weight sum_i cost(x_i, y_i).
///
/// Memory: 8 capacity^2 + 16 P bytes, 8 for each entry of ListNearestOnX, and
/// 8 P capacity when the pools are not tabulated. Not thread-safe. Keeps
/// references to the pools.
class Matching {
 public:
  /// `costs`: nullptr for none.
  Matching(const PointPool& pool_x, const PointPool& pool_y, int capacity,
           const PointCosts* costs = nullptr);
  // Rows point into the matching's own storage: it moves, but is not copied.
  Matching(const Matching&) = delete;
  Matching& operator=(const Matching&) = delete;
  Matching(Matching&&) = default;
  Matching& operator=(Matching&&) = default;

  int size() const { return static_cast<int>(points_[kX].size()); }
  int capacity() const { return capacity_; }
  const PointPool& pool(Side side) const { return *pools_[side]; }

  /// The point of match `i` on a side.
  int point(Side side, int i) const { return points_[side][i]; }
  bool is_matched(Side side, int point) const {
    return is_matched_[side][point];
  }
  std::vector<PointMatch> Matches() const;

  /// Closeness between the points of matches i and j.
  float closeness(Side side, int i, int j) const {
    return closeness_[side](i, j);
  }
  /// Closeness of the point of match `i` to all points of its pool.
  const float* Row(Side side, int i) const { return rows_[side][i]; }

  /// REQUIRES: both points unmatched, size() < capacity().
  void Add(PointMatch match);

  /// The first `count` matches are to stay as they are: annealing leaves them
  /// alone.
  void Pin(int count) { pinned_ = count; }
  int pinned() const { return pinned_; }

  /// The unmatched point farthest from all matched ones; ties by smallest
  /// index; -1 when all are matched. Eq. 5 falls with distance, so this is
  /// farthest point sampling with respect to the matches (Section 3.3.1).
  int FarthestUnmatched(Side side) const;

  /// The unmatched point of least value, ties by smallest index; -1 when all
  /// are matched. `values`: one for each point of the pool.
  int LeastUnmatched(Side side,
                     const Eigen::Ref<const Eigen::ArrayXf>& values) const;

  /// The unmatched one of `points` that is nearest to any match, ties by order;
  /// -1 when all are matched.
  int NearestUnmatched(Side side, const std::vector<int>& points) const;

  /// Eq. 8 for matching `point` of `side` with each of `candidates` on the
  /// other side: errors[c] = sum_i |k(point, point_i) - k(candidate_c,
  /// image_i)|, and half the size times the weighted cost of the match. Time
  /// O(size candidates).
  void EmbeddingErrors(Side side, int point, const std::vector<int>& candidates,
                       std::vector<float>* errors) const;
  /// The same for all points of the other pool.
  void EmbeddingErrors(Side side, int point, std::vector<float>* errors) const;
  /// The same for its first `count` points.
  void EmbeddingErrors(Side side, int point, int count,
                       std::vector<float>* errors) const;

  /// Lists the `count` nearest matches on X of each match (all others, of
  /// fewer), nearest first, ties by index. Time O(count) for each pair that has
  /// a match added since the last call.
  void ListNearestOnX(int count);
  /// As listed last.
  absl::Span<const int> NearestOnX(int i) const {
    return absl::MakeConstSpan(near_).subspan(
        i * near_count_, std::min<std::size_t>(near_count_, near_listed_ - 1));
  }

  /// Change of the energy if matches i and j exchanged their images on Y.
  double SwapChange(int i, int j) const;
  void Swap(int i, int j);

  /// Change of the energy if match i went to each of the unmatched points `ys`.
  void RelocateChanges(int i, const std::vector<int>& ys,
                       std::vector<float>* changes) const;
  void Relocate(int i, int y);

  /// The energy, evaluated in full: O(size^2).
  double Energy() const;

 private:
  using Table =
      Eigen::Array<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  /// Weighted cost of a match; 0 without costs.
  float Cost(int x, int y) const {
    return costs_ == nullptr ? 0 : costs_->weight * costs_->of_match(y, x);
  }
  void SetPoint(Side side, int i, int point);
  /// Match `i`, whose list holds `listed` others, is told of another one.
  void OfferNear(int i, std::size_t listed, int other);
  void CoverBy(Side side, const float* row);

  std::array<const PointPool*, 2> pools_;
  const PointCosts* costs_;
  int capacity_;
  int pinned_ = 0;
  std::array<std::vector<int>, 2> points_;  ///< of each match
  std::array<std::vector<const float*>, 2> rows_;
  std::array<std::vector<std::vector<float>>, 2> row_storage_;
  /// By match, capacity x that in whole lanes; 0 where there is no match.
  std::array<Table, 2> closeness_;
  std::size_t near_count_ = 0;         ///< most entries of a list
  std::size_t near_listed_ = 0;        ///< matches that are in the lists
  std::vector<int> near_;              ///< lists of ListNearestOnX
  std::vector<float> near_closeness_;  ///< of their entries
  std::array<std::vector<char>, 2> is_matched_;  ///< of each point
  /// Closeness of each point to the nearest match there has been.
  std::array<Eigen::ArrayXf, 2> coverage_;
};

}  // namespace isomatch
