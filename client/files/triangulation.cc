#include "client/files/triangulation.h"

namespace isomatch {
namespace {

// The corner from which a fan cuts the polygon: the first, or the second when
// a quadrilateral's other diagonal is shorter.
std::size_t FanStart(const std::vector<std::size_t>& polygon,
                     const Positions& positions) {
  if (polygon.size() != 4) return 0;
  const auto squared = [&](std::size_t a, std::size_t b) {
    return (positions.row(static_cast<Eigen::Index>(polygon[a])) -
            positions.row(static_cast<Eigen::Index>(polygon[b])))
        .squaredNorm();
  };
  return squared(1, 3) < squared(0, 2) ? 1 : 0;
}

}  // namespace

std::vector<CutTriangle> CutPolygons(
    const std::vector<std::vector<std::size_t>>& polygons,
    const Positions& positions) {
  std::size_t count = 0;
  for (const auto& polygon : polygons) count += polygon.size() - 2;
  std::vector<CutTriangle> triangles;
  triangles.reserve(count);
  for (std::size_t p = 0; p < polygons.size(); ++p) {
    const std::size_t size = polygons[p].size();
    const std::size_t start = FanStart(polygons[p], positions);
    for (std::size_t i = 1; i + 1 < size; ++i) {
      triangles.push_back(
          {p, {start, (start + i) % size, (start + i + 1) % size}});
    }
  }
  return triangles;
}

}  // namespace isomatch
