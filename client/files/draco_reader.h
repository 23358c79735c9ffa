#pragma once

#include <optional>

#include "absl/strings/string_view.h"
#include "client/files/polygon_soup.h"

namespace isomatch {

/// Reads the triangles of a Draco file. Vertices are numbered by its vertex_id
/// attribute, as EncodeDraco writes it; without one as Draco's decoder returns
/// them, with a warning where that is not the order before they were encoded.
/// Faces are sorted (core/io/draco_mesh.h), colors and texture left out.
///
/// Returns the first fault. Safe on hostile bytes, as DecodeDraco.
std::optional<MeshFault> ReadDracoSoup(absl::string_view bytes,
                                       PolygonSoup* soup);

}  // namespace isomatch
