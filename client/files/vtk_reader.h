#pragma once

#include <optional>

#include "absl/strings/string_view.h"
#include "client/files/polygon_soup.h"

namespace isomatch {

/// Reads the polygons and triangle strips of a legacy VTK file, ASCII or
/// BINARY, versions 1 to 5: of POLYDATA, and the triangles, quadrilaterals,
/// polygons and strips of an UNSTRUCTURED_GRID, as meshio writes it. Vertices,
/// lines and other cells are left out, as is all data of points and cells.
///
/// Returns the first fault, by line, in binary data by byte. Counts are
/// compared with the file's size before anything is allocated for them. Time
/// and memory are proportional to it.
std::optional<MeshFault> ReadVtkSoup(absl::string_view bytes,
                                     PolygonSoup* soup);

}  // namespace isomatch
