#pragma once

#include <optional>

#include "absl/strings/string_view.h"
#include "client/files/polygon_soup.h"

namespace isomatch {

/// The material of faces that have none, after faces that have one.
inline constexpr char kNoMaterial[] = "(none)";

/// Reads the vertices `v`, with their colors, the texture coordinates `vt`, the
/// faces `f` and the names of materials of an OBJ file. Numbers of vertices and
/// texture coordinates may count back from the last one; a face may stand
/// before its vertices, but not before its texture coordinates. Colors are
/// three numbers after the coordinates, of 0 to 255 when one is above 1.
/// Everything else is left out: normals, groups, and the points and lines that
/// modelling programs write for loose vertices and edges. What OBJ does not
/// have, and free-form surfaces, are told in the warnings.
///
/// Returns the first line that is wrong, if any. Time and memory are
/// proportional to the size of `text`.
std::optional<MeshFault> ReadObjSoup(absl::string_view text, PolygonSoup* soup);

}  // namespace isomatch
