#pragma once

#include <optional>

#include "absl/strings/string_view.h"
#include "client/files/polygon_soup.h"

namespace isomatch {

/// Reads the polygons and triangle strips of a VTK XML file of PolyData (.vtp):
/// all pieces, one after another. Arrays are ascii, base64 in their place, or
/// appended as base64 or raw, packed by zlib or not, of either byte order.
/// Vertices, lines and the data of points and cells are left out.
///
/// Returns the first fault, by byte of the XML or by piece and array. Counts
/// are compared with the bytes that are there before anything is allocated for
/// them. Time and memory are proportional to the size, packed bytes unpacked.
std::optional<MeshFault> ReadVtpSoup(absl::string_view bytes,
                                     PolygonSoup* soup);

}  // namespace isomatch
