#pragma once

#include <optional>

#include "absl/strings/string_view.h"
#include "client/files/mesh_fault.h"
#include "client/files/polygon_soup.h"

namespace isomatch {

/// Reads the vertices and faces of the text of an OFF file. Normals, colors and
/// texture coordinates (NOFF, COFF, STOFF) are left out: what follows on a line
/// of a vertex or face. Coordinates of 4OFF are homogeneous.
///
/// Returns the first thing that is wrong, if any: a count that is none or that
/// the file is too short for, a number that is none or not finite, an index out
/// of range, an end too early. Time and memory are proportional to the size of
/// `text`.
std::optional<MeshFault> ReadOffSoup(absl::string_view text, PolygonSoup* soup);

}  // namespace isomatch
