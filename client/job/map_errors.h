#pragma once

#include <optional>
#include <stop_token>
#include <string>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "core/base/vertex_index.h"
#include "core/evaluation/geodesic_error.h"
#include "core/mesh/surface_point.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// A map whose error is wanted.
struct FoundMap {
  /// For each vertex of X its vertex of Y.
  absl::Span<const VertexIndex> vertices;
  /// Where the map is precise, for each vertex of X its place on `faces`, which
  /// is measured then.
  absl::Span<const SurfacePoint> places = {};
  /// The faces of Y's file.
  const Faces* faces = nullptr;
  /// X, of as many vertices, whose areas weigh MapErrors::iou; without it each
  /// vertex weighs the same.
  const TriangleMesh* mesh_x = nullptr;
};

/// How far a map is from the truth, and from its mirror image where the truth
/// knows that.
struct MapErrors {
  GeodesicError direct;
  std::optional<GeodesicError> mirrored;
  /// Of the part of X that has a counterpart, as OverlapIou.
  std::optional<double> iou = {};
};

/// Measures a map into `mesh_y` against the file `truth`. Errors as
/// ReadGroundTruth and GeodesicErrorMeter::Measure.
absl::StatusOr<MapErrors> MeasureAgainstTruth(const FoundMap& found,
                                              const TriangleMesh& mesh_y,
                                              const std::string& truth,
                                              const std::stop_token& stop);

}  // namespace isomatch
