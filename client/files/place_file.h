#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/mesh/precise_point.h"
#include "core/mesh/surface_point.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// Where the vertices of X lie on Y, and whether between its vertices.
struct PlacesOnY {
  /// One for each vertex of X.
  std::vector<PrecisePoint> points;
  /// False when they are vertices of Y: each three times, weight 1 for the
  /// first.
  bool is_precise = false;
  /// The same on the faces of Y, when they are precise; else empty.
  std::vector<SurfacePoint> on_faces = {};

  /// Returns for each of `points` its vertex of largest weight, the first of
  /// equal ones; kNoVertex for no place.
  VertexMap HeaviestVertices() const;
};

/// Returns the places that a file tells: a map of any format
/// (client/files/map_file.h), or lines `FACE W0 W1 W2` as `isomatch match
/// --precise` writes them, known by their four numbers.
///
/// INVALID_ARGUMENT, naming file, line or entry, what was found and what was
/// expected: not as many as X has vertices, where that is given, a vertex or
/// face that Y does not have, weights that are not of [0, 1] with sum 1;
/// NOT_FOUND.
absl::StatusOr<PlacesOnY> ReadPlaces(const std::string& path,
                                     std::optional<VertexIndex> vertices_x,
                                     const TriangleMesh& mesh_y);

}  // namespace isomatch
