#include "core/matching/closeness.h"

#include <algorithm>
#include <utility>

#include <Eigen/Core>

#include "core/base/parallel.h"
#include "core/base/status_macros.h"

namespace isomatch {

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
  // In whole aligned blocks: on a plain array, which entries take the vector
  // path of exp, and so their last bits, would depend on its address.
  using Block = Eigen::Array<float, 64, 1>;
  Block block = Block::Zero();
  for (std::size_t begin = 0; begin < vertices.size(); begin += block.size()) {
    const std::size_t count =
        std::min<std::size_t>(block.size(), vertices.size() - begin);
    std::copy_n(row + begin, count, block.data());
    block = (-inverse_width_ * block).exp();
    std::copy_n(block.data(), count, row + begin);
  }
}

std::vector<int> ClosestOf(const float* closeness, int size, int self,
                           int count) {
  // Kept sorted: most entries are beaten by the last of a few and go no
  // further. Equal ones stay in order of index, as they come in it.
  std::vector<int> closest;
  std::vector<float> values;
  closest.reserve(std::max(count, 0));
  values.reserve(std::max(count, 0));
  for (int i = 0; i < size && count > 0; ++i) {
    const float value = closeness[i];
    if (i == self) continue;
    if (static_cast<int>(values.size()) < count) {
      values.push_back(value);
      closest.push_back(i);
    } else if (!(value > values.back())) {
      continue;
    }
    std::size_t at = values.size() - 1;
    for (; at > 0 && values[at - 1] < value; --at) {
      values[at] = values[at - 1];
      closest[at] = closest[at - 1];
    }
    values[at] = value;
    closest[at] = i;
  }
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
  const int near = std::min(kNearest, pool.size() - 1);
  pool.nearest_.resize(std::int64_t{pool.size()} * near);
  ISOMATCH_RETURN_IF_ERROR(
      ParallelFor(pool.size(), stop, [&](std::int64_t point) {
        float* row = pool.table_.data() + point * pool.size();
        closeness.Row(pool.vertices_[point], pool.vertices_, row);
        const std::vector<int> closest =
            ClosestOf(row, pool.size(), static_cast<int>(point), near);
        std::copy(closest.begin(), closest.end(),
                  pool.nearest_.data() + point * near);
      }));
  return pool;
}

const float* PointPool::Row(int point, std::vector<float>* storage) const {
  if (!table_.empty()) return table_.data() + std::int64_t{point} * size();
  storage->resize(vertices_.size());
  closeness_->Row(vertices_[point], vertices_, storage->data());
  return storage->data();
}

}  // namespace isomatch
