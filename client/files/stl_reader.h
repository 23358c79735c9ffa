#pragma once

#include <optional>

#include "absl/strings/string_view.h"
#include "client/files/polygon_soup.h"

namespace isomatch {

/// Reads the triangles of a text or binary STL file. It has no vertices of its
/// own: corners at one position become one, numbered in order of first use,
/// which a warning says.
///
/// Returns the first thing that is wrong, if any. Time and memory are
/// proportional to the size of `bytes`.
std::optional<MeshFault> ReadStlSoup(absl::string_view bytes,
                                     PolygonSoup* soup);

}  // namespace isomatch
