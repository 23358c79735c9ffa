#include "core/mesh/spatial_order.h"

#include <cmath>
#include <cstdint>
#include <numeric>
#include <utility>

#include "core/base/sorted_buckets.h"

namespace isomatch {
namespace {

constexpr int kBits = 10;
/// Bits of a code that its bucket does not tell.
constexpr int kBitsInBucket = 15;

/// The bits of each number below 1 << kBits, at every third place.
std::vector<std::uint32_t> SpreadBits() {
  std::vector<std::uint32_t> spread(std::size_t{1} << kBits, 0);
  for (std::uint32_t value = 0; value < spread.size(); ++value) {
    for (int bit = 0; bit < kBits; ++bit) {
      spread[value] |= ((value >> bit) & 1u) << (3 * bit);
    }
  }
  return spread;
}

}  // namespace

std::vector<VertexIndex> SpatialOrder(const Positions& positions) {
  const Eigen::RowVector3d low = positions.colwise().minCoeff();
  const double extent = (positions.colwise().maxCoeff() - low).maxCoeff();
  const double scale = ((1 << kBits) - 1) / extent;
  if (!std::isfinite(scale) || !std::isnormal(extent)) {
    std::vector<VertexIndex> as_given(positions.rows());
    std::iota(as_given.begin(), as_given.end(), 0);
    return as_given;
  }
  const std::vector<std::uint32_t> spread = SpreadBits();
  std::vector<std::uint32_t> codes(positions.rows(), 0);
  for (Eigen::Index v = 0; v < positions.rows(); ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      const auto cell =
          static_cast<std::uint32_t>(scale * (positions(v, axis) - low[axis]));
      codes[v] |= spread[cell] << axis;
    }
  }
  const SortedBuckets<std::pair<std::uint32_t, VertexIndex>> by_code(
      std::ssize(codes), std::int64_t{1} << (3 * kBits - kBitsInBucket),
      [&](std::int64_t v) { return codes[v] >> kBitsInBucket; },
      [&](std::int64_t v) {
        return std::pair(codes[v], static_cast<VertexIndex>(v));
      });
  std::vector<VertexIndex> order;
  order.reserve(codes.size());
  for (const auto& [code, v] : by_code.items()) order.push_back(v);
  return order;
}

}  // namespace isomatch
