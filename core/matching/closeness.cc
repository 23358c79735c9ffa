#include "core/matching/closeness.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "core/base/lanes.h"
#include "core/base/parallel.h"
#include "core/base/status_macros.h"
#include "core/matching/nearest_list.h"

namespace isomatch {
namespace {

/// exp is taken of whole aligned blocks: on a plain array, which entries take
/// its vector path, and so their last bits, would depend on the address.
using Block = Eigen::Array<float, 64, 1>;
constexpr Eigen::Index kBlock = Block::SizeAtCompileTime;
constexpr Eigen::Index kLanesOfBlock = kBlock / kLanes;

}  // namespace

float Closeness::operator()(VertexIndex u, VertexIndex v) const {
  float closeness;
  Row(u, {v}, &closeness);
  return closeness;
}

void Closeness::Row(VertexIndex u, absl::Span<const VertexIndex> vertices,
                    float* row) const {
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    row[i] = basis_->LowerBound(u, vertices[i]);
  }
  Block block = Block::Zero();
  for (std::size_t begin = 0; begin < vertices.size(); begin += block.size()) {
    const std::size_t count =
        std::min<std::size_t>(block.size(), vertices.size() - begin);
    std::copy_n(row + begin, count, block.data());
    block = (-inverse_width_ * block).exp();
    std::copy_n(block.data(), count, row + begin);
  }
}

ClosenessRows::ClosenessRows(const Closeness& closeness,
                             absl::Span<const VertexIndex> vertices)
    : closeness_(closeness),
      count_(std::ssize(vertices)),
      stride_((count_ + kBlock - 1) / kBlock * kBlock),
      profiles_(stride_ * closeness.basis().num_points(), 0) {
  const int points = closeness.basis().num_points();
  for (Eigen::Index i = 0; i < count_; ++i) {
    const float* const profile = closeness.basis().Profile(vertices[i]);
    for (int z = 0; z < points; ++z) profiles_[z * stride_ + i] = profile[z];
  }
}

void ClosenessRows::Row(VertexIndex u, float* row) const {
  const float* const profile = closeness_.basis().Profile(u);
  const int points = closeness_.basis().num_points();
  for (Eigen::Index begin = 0; begin < count_; begin += kBlock) {
    // The largest difference of distances, Eq. 6.
    Lanes largest[kLanesOfBlock] = {};
    for (int z = 0; z < points; ++z) {
      const float* const others = profiles_.data() + z * stride_ + begin;
      for (int i = 0; i < kLanesOfBlock; ++i) {
        const Lanes difference =
            AbsLanes(LoadLanes(others + i * kLanes) - profile[z]);
        largest[i] = MaxLanes(largest[i], difference);
      }
    }
    Block block;
    for (int i = 0; i < kLanesOfBlock; ++i) {
      StoreLanes(largest[i], block.data() + i * kLanes);
    }
    block = (-closeness_.inverse_width() * block).exp();
    std::copy_n(block.data(), std::min(kBlock, count_ - begin), row + begin);
  }
}

int LeastOf(absl::Span<const float> values) {
  // The value alone is found many times faster than its place.
  const float least =
      Eigen::Map<const Eigen::ArrayXf>(values.data(), std::ssize(values))
          .minCoeff();
  return static_cast<int>(std::find(values.begin(), values.end(), least) -
                          values.begin());
}

std::vector<int> ClosestOf(const float* closeness, int size, int self,
                           int count) {
  if (count <= 0) return {};
  std::vector<int> closest(count);
  std::vector<float> values(count);
  const NearestList list = {closest.data(), values.data(), closest.size()};
  std::size_t offered = 0;
  for (int i = 0; i < size; ++i) {
    if (i != self) list.Offer(offered++, i, closeness[i]);
  }
  closest.resize(std::min(offered, closest.size()));
  return closest;
}

absl::StatusOr<PointPool> PointPool::Create(const Closeness& closeness,
                                            std::vector<VertexIndex> vertices,
                                            const std::stop_token& stop) {
  PointPool pool;
  pool.closeness_ = &closeness;
  pool.vertices_ = std::move(vertices);
  if (pool.size() > kMaxTabulated) return pool;
  pool.table_.resize(std::int64_t{pool.size()} * pool.size());
  const ClosenessRows rows(closeness, pool.vertices_);
  ISOMATCH_RETURN_IF_ERROR(
      ParallelFor(pool.size(), stop, [&](std::int64_t point) {
        rows.Row(pool.vertices_[point],
                 pool.table_.data() + point * pool.size());
      }));
  return pool;
}

absl::Status PointPool::ListNearest(const std::stop_token& stop) {
  if (table_.empty()) return absl::OkStatus();
  const int near = std::min(kNearest, size() - 1);
  nearest_.resize(std::int64_t{size()} * near);
  return ParallelFor(size(), stop, [&](std::int64_t point) {
    const std::vector<int> closest = ClosestOf(
        table_.data() + point * size(), size(), static_cast<int>(point), near);
    std::copy(closest.begin(), closest.end(), nearest_.data() + point * near);
  });
}

const float* PointPool::Row(int point, std::vector<float>* storage) const {
  if (!table_.empty()) return table_.data() + std::int64_t{point} * size();
  storage->resize(vertices_.size());
  closeness_->Row(vertices_[point], vertices_, storage->data());
  return storage->data();
}

}  // namespace isomatch
