#include "core/matching/matching.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <utility>

#include "core/base/lanes.h"
#include "core/matching/nearest_list.h"

namespace isomatch {

Matching::Matching(const PointPool& pool_x, const PointPool& pool_y,
                   int capacity, const PointCosts* costs)
    : pools_{&pool_x, &pool_y}, costs_(costs), capacity_(capacity) {
  for (const Side side : {kX, kY}) {
    row_storage_[side].resize(capacity);
    closeness_[side].setZero(capacity,
                             (capacity + kLanes - 1) / kLanes * kLanes);
    is_matched_[side].assign(pools_[side]->size(), false);
    coverage_[side].setZero(pools_[side]->size());
  }
}

std::vector<PointMatch> Matching::Matches() const {
  std::vector<PointMatch> matches;
  matches.reserve(static_cast<std::size_t>(size()));
  for (int i = 0; i < size(); ++i) {
    matches.push_back({points_[kX][i], points_[kY][i]});
  }
  return matches;
}

void Matching::SetPoint(Side side, int i, int point) {
  points_[side][i] = point;
  is_matched_[side][point] = true;
  rows_[side][i] = pools_[side]->Row(point, &row_storage_[side][i]);
  for (int j = 0; j < size(); ++j) {
    const float value = rows_[side][i][points_[side][j]];
    closeness_[side](i, j) = value;
    closeness_[side](j, i) = value;
  }
  CoverBy(side, rows_[side][i]);
}

void Matching::CoverBy(Side side, const float* row) {
  coverage_[side] = coverage_[side].max(
      Eigen::Map<const Eigen::ArrayXf>(row, pools_[side]->size()));
}

void Matching::Add(PointMatch match) {
  assert(size() < capacity_);
  assert(!is_matched_[kX][match.x] && !is_matched_[kY][match.y]);
  const int i = size();
  for (const Side side : {kX, kY}) {
    points_[side].push_back(kNoVertex);
    rows_[side].push_back(nullptr);
    points_[side][i] = side == kX ? match.x : match.y;
  }
  SetPoint(kX, i, match.x);
  SetPoint(kY, i, match.y);
}

int Matching::FarthestUnmatched(Side side) const {
  return LeastUnmatched(side, coverage_[side]);
}

int Matching::LeastUnmatched(
    Side side, const Eigen::Ref<const Eigen::ArrayXf>& values) const {
  const int first =
      LeastOf({values.data(), static_cast<std::size_t>(values.size())});
  if (first < values.size() && !is_matched_[side][first]) return first;
  int best = -1;
  float least = std::numeric_limits<float>::infinity();
  for (int p = 0; p < values.size(); ++p) {
    if (is_matched_[side][p] || values[p] >= least) continue;
    least = values[p];
    best = p;
  }
  return best;
}

int Matching::NearestUnmatched(Side side,
                               const std::vector<int>& points) const {
  int nearest = -1;
  for (const int p : points) {
    if (is_matched_[side][p]) continue;
    if (nearest < 0 || coverage_[side][p] > coverage_[side][nearest]) {
      nearest = p;
    }
  }
  return nearest;
}

void Matching::EmbeddingErrors(Side side, int point,
                               const std::vector<int>& candidates,
                               std::vector<float>* errors) const {
  errors->assign(candidates.size(), 0);
  for (int i = 0; i < size(); ++i) {
    const float wanted = rows_[side][i][point];
    const float* const row = rows_[Other(side)][i];
    for (std::size_t c = 0; c < candidates.size(); ++c) {
      (*errors)[c] += std::abs(wanted - row[candidates[c]]);
    }
  }
  if (costs_ == nullptr) return;
  const float share = 0.5f * static_cast<float>(size());
  for (std::size_t c = 0; c < candidates.size(); ++c) {
    (*errors)[c] += share * (side == kX ? Cost(point, candidates[c])
                                        : Cost(candidates[c], point));
  }
}

void Matching::EmbeddingErrors(Side side, int point,
                               std::vector<float>* errors) const {
  EmbeddingErrors(side, point, pools_[Other(side)]->size(), errors);
}

void Matching::EmbeddingErrors(Side side, int point, int count,
                               std::vector<float>* errors) const {
  errors->assign(count, 0);
  Eigen::Map<Eigen::ArrayXf> sums(errors->data(), count);
  const auto part = [&](int match) {
    const float wanted = rows_[side][match][point];
    return (Eigen::Map<const Eigen::ArrayXf>(rows_[Other(side)][match], count) -
            wanted)
        .abs();
  };
  // Four at a time, so that the sums are read and written less often.
  int i = 0;
  for (; i + 4 <= size(); i += 4) {
    sums += (part(i) + part(i + 1)) + (part(i + 2) + part(i + 3));
  }
  for (; i < size(); ++i) sums += part(i);
  if (costs_ == nullptr) return;
  const float share = 0.5f * costs_->weight * static_cast<float>(size());
  if (side == kX) {
    sums += share * costs_->of_match.col(point).head(count).array();
  } else {
    sums += share * costs_->of_match.row(point).head(count).transpose().array();
  }
}

void Matching::OfferNear(int i, std::size_t listed, int other) {
  const NearestList list = {near_.data() + i * near_count_,
                            near_closeness_.data() + i * near_count_,
                            near_count_};
  list.Offer(listed, other, closeness_[kX](i, other));
}

void Matching::ListNearestOnX(int count) {
  const auto wanted = static_cast<std::size_t>(
      std::clamp(count, 1, std::max(capacity_ - 1, 1)));
  if (wanted != near_count_) {
    near_count_ = wanted;
    near_listed_ = 0;
    near_.resize(near_count_ * capacity_);
    near_closeness_.resize(near_count_ * capacity_);
  }
  for (; near_listed_ < points_[kX].size(); ++near_listed_) {
    const int added = static_cast<int>(near_listed_);
    for (int i = 0; i < added; ++i) {
      OfferNear(i, near_listed_ - 1, added);
      OfferNear(added, i, i);
    }
  }
}

double Matching::SwapChange(int i, int j) const {
  const float* const x_i = closeness_[kX].row(i).data();
  const float* const x_j = closeness_[kX].row(j).data();
  const float* const y_i = closeness_[kY].row(i).data();
  const float* const y_j = closeness_[kY].row(j).data();
  Lanes changes = {};
  for (int k = 0; k < size(); k += kLanes) {
    const Lanes xi = LoadLanes(x_i + k);
    const Lanes xj = LoadLanes(x_j + k);
    const Lanes yi = LoadLanes(y_i + k);
    const Lanes yj = LoadLanes(y_j + k);
    changes += AbsLanes(xi - yj) + AbsLanes(xj - yi) - AbsLanes(xi - yi) -
               AbsLanes(xj - yj);
  }
  // The pair (i, j) itself keeps its two values, so its terms do not count.
  const auto own = [&](int k) {
    return std::abs(x_i[k] - y_j[k]) + std::abs(x_j[k] - y_i[k]) -
           std::abs(x_i[k] - y_i[k]) - std::abs(x_j[k] - y_j[k]);
  };
  const double by_pairs = 2.0 * (double{SumOfLanes(changes)} - own(i) - own(j));
  if (costs_ == nullptr) return by_pairs;
  const double by_costs = Cost(points_[kX][i], points_[kY][j]) +
                          Cost(points_[kX][j], points_[kY][i]) -
                          Cost(points_[kX][i], points_[kY][i]) -
                          Cost(points_[kX][j], points_[kY][j]);
  return by_pairs + (size() - 1) * by_costs;
}

void Matching::Swap(int i, int j) {
  std::swap(points_[kY][i], points_[kY][j]);
  std::swap(rows_[kY][i], rows_[kY][j]);
  std::swap(row_storage_[kY][i], row_storage_[kY][j]);
  Table& table = closeness_[kY];
  table.row(i).swap(table.row(j));
  table.col(i).swap(table.col(j));
}

void Matching::RelocateChanges(int i, const std::vector<int>& ys,
                               std::vector<float>* changes) const {
  const float* const on_x = closeness_[kX].row(i).data();
  const float* const on_y = closeness_[kY].row(i).data();
  changes->resize(ys.size());
  for (std::size_t first = 0; first < ys.size(); first += kLanes) {
    const std::size_t count = std::min<std::size_t>(kLanes, ys.size() - first);
    std::array<int, kLanes> at;
    at.fill(ys[first]);
    std::copy_n(ys.begin() + first, count, at.begin());
    // Term by term, so that what changes nothing is 0.
    Lanes sums = {};
    for (int j = 0; j < size(); ++j) {
      if (j == i) continue;
      sums += AbsLanes(GatherLanes(rows_[kY][j], at.data()) - on_x[j]) -
              std::abs(on_x[j] - on_y[j]);
    }
    for (std::size_t t = 0; t < count; ++t) (*changes)[first + t] = sums[t];
  }
  for (float& change : *changes) change *= 2;  // each pair counts twice
  if (costs_ == nullptr) return;
  const int x = points_[kX][i];
  const float cost = Cost(x, points_[kY][i]);
  for (std::size_t t = 0; t < ys.size(); ++t) {
    (*changes)[t] += static_cast<float>(size() - 1) * (Cost(x, ys[t]) - cost);
  }
}

void Matching::Relocate(int i, int y) {
  is_matched_[kY][points_[kY][i]] = false;
  SetPoint(kY, i, y);
}

double Matching::Energy() const {
  const int n = size();
  double energy = 0;
  for (int i = 0; i < n; ++i) {
    energy += (closeness_[kX].row(i).head(n) - closeness_[kY].row(i).head(n))
                  .abs()
                  .sum();
    energy += (n - 1) * double{Cost(points_[kX][i], points_[kY][i])};
  }
  return energy;
}

}  // namespace isomatch
