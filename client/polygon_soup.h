#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

namespace isomatch {

/// Points and polygons as a file has them; nothing is checked.
struct PolygonSoup {
  std::vector<std::array<double, 3>> points;
  std::vector<std::vector<std::size_t>> polygons;
};

/// Reads a PLY or STL file, known by its extension, through CGAL.
/// Points keep the file's count and order, but for STL: it has no vertices of
/// its own, and corners at one place become one. False when CGAL refuses the
/// file, or memory does not suffice for what it claims.
bool ReadPolygonSoup(const std::string& path, PolygonSoup* soup);

}  // namespace isomatch
