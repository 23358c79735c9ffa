#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/files/point_file.h"
#include "core/base/vertex_index.h"
#include "core/mesh/surface_point.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// A point that was set on a mesh.
struct SnappedPoint {
  std::string label;
  /// The nearest point of the surface, and the vertex of its face that is
  /// nearest to the point.
  SurfacePoint place;
  VertexIndex vertex = kNoVertex;
  /// From the point to the surface and to the vertex, mesh units.
  double distance = 0;
  double vertex_distance = 0;
};

/// The points of a file on a mesh.
struct SnappedPoints {
  std::vector<SnappedPoint> points;
  /// The mesh's coordinate system by the file: LPS, RAS or "" for not said.
  std::string space = {};
  /// How far they were, one line; and what is doubtful about it.
  std::string summary = {};
  std::vector<std::string> warnings = {};
};

/// Reads points and sets each on the surface of `mesh`, which `name` stands for
/// in texts, e.g. "X".
///
/// Positions are numbers of the mesh's file as they are: 3D Slicer has both in
/// LPS. Only where the file names LPS or RAS, the points are on average farther
/// from the surface than 1 % of the diagonal of its bounding box, and come four
/// times nearer with x and y negated, which is the step from one to the other,
/// are these negated, with a warning.
///
/// Points farther than 1 % of the diagonal are named in a warning.
/// INVALID_ARGUMENT: one farther than 20 %, as in another coordinate system or
/// unit; no face; else as ReadPoints. Time O(points (n + m)).
absl::StatusOr<SnappedPoints> ReadSnappedPoints(const std::string& path,
                                                const TriangleMesh& mesh,
                                                const std::string& name);

/// Pairs the points of X with those of Y: by label where all have one, none is
/// there twice in a file and some are in both; those that the other file lacks
/// are left out, with a warning. Else by order.
///
/// INVALID_ARGUMENT: by order, and not as many; two points of one shape at one
/// vertex with different partners. Messages begin with the files.
absl::StatusOr<std::vector<VertexMatch>> PairPoints(
    const SnappedPoints& x, const SnappedPoints& y, const std::string& files,
    std::vector<std::string>* warnings);

}  // namespace isomatch
