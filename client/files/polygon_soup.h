#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "core/base/vertex_index.h"

namespace isomatch {

/// Names of the coordinates, for the texts of faults.
inline constexpr std::array<const char*, 3> kAxisNames = {"x", "y", "z"};

/// What is wrong first in a mesh file.
struct MeshFault {
  /// Where: "line 12", or of a binary file "triangle 3 (0-based)"; "" for the
  /// whole of it.
  std::string where;
  /// What was found and what was expected.
  std::string what;
};

/// A picture of a material, not decoded.
struct SoupImage {
  /// The file that has it, or "" and its bytes.
  std::string path;
  std::string bytes;
};

/// Where the polygons of a file lie in pictures. An entry that is -1, or that
/// stands beyond the end of its vector, is none.
struct SoupTexture {
  std::vector<std::array<double, 2>> coordinates;
  /// For each corner one of `coordinates`, for each polygon one of `materials`.
  std::vector<int> coordinates_of_corner;
  std::vector<int> material_of_polygon;
  std::vector<std::string> materials;
  /// As the file names them.
  std::vector<std::string> libraries;
  /// Pictures of the file itself, and for each of `materials` one of them.
  std::vector<SoupImage> images;
  std::vector<int> image_of_material;
};

/// What one pass over a mesh file finds. A reader that returned no fault has
/// checked that every polygon has three corners or more and that each of them
/// is one of `points`; there may be none of both.
struct PolygonSoup {
  /// E.g. "PLY, binary little endian".
  std::string format;
  std::vector<std::array<double, 3>> points;
  /// The vertices of all polygons, one after another, and how many each has.
  std::vector<VertexIndex> corners;
  std::vector<VertexIndex> sizes;
  /// Red, green and blue of each point as fractions of 1; empty for none.
  std::vector<std::array<double, 3>> colors;
  SoupTexture texture;
  /// Why there is none of these. The polygons are good all the same.
  std::optional<MeshFault> color_fault;
  std::optional<MeshFault> texture_fault;
  /// What the user should know, in words.
  std::vector<std::string> warnings;
};

}  // namespace isomatch
