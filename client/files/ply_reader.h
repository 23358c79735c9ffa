#pragma once

#include <optional>

#include "absl/strings/string_view.h"
#include "client/files/polygon_soup.h"

namespace isomatch {

/// Reads the vertices, their colors and the faces of a PLY file, text or
/// binary; other elements and properties are left out. Colors are the
/// properties red, green and blue, with or without diffuse_ before: fractions
/// where their type is one, else the largest number of the type stands for 1.
///
/// Returns the first thing that is wrong, if any, which the counts of the
/// header and the lengths of lists are too where they are more than `bytes` can
/// hold. Time and memory are proportional to the size of `bytes`.
std::optional<MeshFault> ReadPlySoup(absl::string_view bytes,
                                     PolygonSoup* soup);

}  // namespace isomatch
