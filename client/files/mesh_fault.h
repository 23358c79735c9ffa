#pragma once

#include <array>
#include <string>

namespace isomatch {

/// Of the coordinates, for what a fault says.
inline constexpr std::array<const char*, 3> kAxisNames = {"x", "y", "z"};

/// What is wrong first in a mesh file.
struct MeshFault {
  /// Where: "line 12", or of a binary file "triangle 3 (0-based)"; "" for the
  /// whole of it.
  std::string place;
  /// What was found and what was expected.
  std::string what;
};

}  // namespace isomatch
