#include "core/evaluation/overlap_iou.h"

#include <cassert>
#include <cstddef>

#include "core/mesh/mesh_geometry.h"

namespace isomatch {

std::vector<double> VertexAreas(const TriangleMesh& mesh) {
  std::vector<double> areas(static_cast<std::size_t>(mesh.num_vertices()));
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    const double third = FaceArea(mesh, f) / 3;
    for (int i = 0; i < 3; ++i) {
      areas[static_cast<std::size_t>(mesh.faces(f, i))] += third;
    }
  }
  return areas;
}

std::optional<double> OverlapIou(absl::Span<const VertexIndex> found,
                                 absl::Span<const VertexIndex> truth,
                                 const std::vector<bool>& named,
                                 absl::Span<const double> weights) {
  assert(found.size() == truth.size() && found.size() == weights.size());
  assert(named.empty() || named.size() == truth.size());
  bool leaves_out = false;
  double both = 0;
  double either = 0;
  for (std::size_t x = 0; x < truth.size(); ++x) {
    if (!named.empty() && !named[x]) continue;
    const bool is_found = found[x] != kNoVertex;
    const bool is_true = truth[x] != kNoVertex;
    leaves_out = leaves_out || (weights[x] > 0 && !(is_found && is_true));
    if (is_found && is_true) both += weights[x];
    if (is_found || is_true) either += weights[x];
  }
  if (!leaves_out) return std::nullopt;
  return either > 0 ? both / either : 1;
}

}  // namespace isomatch
