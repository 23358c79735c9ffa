#pragma once

#include <optional>
#include <vector>

#include "absl/types/span.h"
#include "core/base/vertex_index.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// Returns n numbers: a third of the area of each vertex's faces, squared mesh
/// units.
std::vector<double> VertexAreas(const TriangleMesh& mesh);

/// How well a map and the truth agree on which part of X has a counterpart:
/// with M the vertices of X that `found` matches and T those that have a
/// counterpart by `truth` (both y_from_x, kNoVertex for none), weight(M and T)
/// / weight(M or T), 0 to 1; 1 when both are empty. Only vertices that are
/// `named` count; empty: all.
///
/// Not set when neither leaves out a vertex of positive weight that counts, as
/// maps of whole shapes do not.
///
/// REQUIRES: as many of each as X has vertices, weights not negative.
std::optional<double> OverlapIou(absl::Span<const VertexIndex> found,
                                 absl::Span<const VertexIndex> truth,
                                 const std::vector<bool>& named,
                                 absl::Span<const double> weights);

}  // namespace isomatch
