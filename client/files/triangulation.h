#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// A triangle cut from a polygon.
struct CutTriangle {
  std::size_t polygon;
  /// Which of the polygon's corners.
  std::array<std::size_t, 3> corners;
};

/// Returns the triangles of all polygons, in order: quadrilaterals are cut
/// along their shorter diagonal, larger polygons into a fan around their first
/// corner. REQUIRES: three corners or more each, all below positions.rows().
std::vector<CutTriangle> CutPolygons(
    const std::vector<std::vector<std::size_t>>& polygons,
    const Positions& positions);

}  // namespace isomatch
