#pragma once

#include <optional>

#include "absl/strings/string_view.h"
#include "client/files/polygon_soup.h"

namespace isomatch {

/// Reads the vertices, their colors and the faces of the text of an OFF file.
/// Colors are three numbers after the coordinates, and after the normals of
/// NOFF, of 0 to 255 unless one of them is a fraction. What else follows on a
/// line of a vertex or face is left out. Coordinates of 4OFF are homogeneous.
///
/// Returns the first thing that is wrong, if any: a count that is none or that
/// the file is too short for, a number that is none or not finite, an index out
/// of range, an end too early. Time and memory are proportional to the size of
/// `text`.
std::optional<MeshFault> ReadOffSoup(absl::string_view text, PolygonSoup* soup);

}  // namespace isomatch
