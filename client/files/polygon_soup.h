#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace isomatch {

/// Points and polygons as a file has them; nothing is checked.
struct PolygonSoup {
  std::vector<std::array<double, 3>> points;
  std::vector<std::vector<std::size_t>> polygons;
};

}  // namespace isomatch
