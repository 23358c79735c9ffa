#include "core/mesh/spatial_order.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <utility>

namespace isomatch {
namespace {

constexpr int kBits = 10;

/// Spreads the bits of `value` to every third place.
std::uint32_t Spread(std::uint32_t value) {
  std::uint32_t spread = 0;
  for (int bit = 0; bit < kBits; ++bit) {
    spread |= ((value >> bit) & 1u) << (3 * bit);
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
  std::vector<std::pair<std::uint32_t, VertexIndex>> coded;
  for (Eigen::Index v = 0; v < positions.rows(); ++v) {
    std::uint32_t code = 0;
    for (int axis = 0; axis < 3; ++axis) {
      code |= Spread(static_cast<std::uint32_t>(
                  scale * (positions(v, axis) - low[axis])))
              << axis;
    }
    coded.emplace_back(code, static_cast<VertexIndex>(v));
  }
  std::sort(coded.begin(), coded.end());
  std::vector<VertexIndex> order;
  order.reserve(coded.size());
  for (const auto& [code, v] : coded) order.push_back(v);
  return order;
}

}  // namespace isomatch
