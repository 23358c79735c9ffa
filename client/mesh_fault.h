#pragma once

#include <optional>
#include <string>

#include "absl/strings/string_view.h"

namespace isomatch {

/// What is wrong first in a mesh file.
struct MeshFault {
  /// Where: "line 12", or of a binary file "triangle 3 (0-based)"; "" for the
  /// whole of it.
  std::string place;
  /// What was found and what was expected.
  std::string what;
};

/// Returns the first fault of a PLY file, which is one also where the counts of
/// its header, or the lengths of its lists, are more than `bytes` can hold: to
/// be asked before any reader allocates for them.
std::optional<MeshFault> FindPlyFault(absl::string_view bytes);

/// Returns the first fault of a text or binary STL file.
std::optional<MeshFault> FindStlFault(absl::string_view bytes);

}  // namespace isomatch
