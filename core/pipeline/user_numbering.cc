#include "core/pipeline/user_numbering.h"

#include "core/base/parallel.h"
#include "core/base/status_macros.h"

namespace isomatch {

VertexMap ToUserMap(const WorkingMesh& x, const WorkingMesh& y,
                    const VertexMap& y_from_x) {
  VertexMap user_map;
  user_map.reserve(x.working_from_user.size());
  for (const VertexIndex v : x.working_from_user) {
    const VertexIndex image = v == kNoVertex ? kNoVertex : y_from_x[v];
    user_map.push_back(image == kNoVertex ? kNoVertex
                                          : y.user_from_working[image]);
  }
  return user_map;
}

absl::StatusOr<std::vector<PrecisePoint>> ToUserPoints(
    const WorkingMesh& x, const WorkingMesh& y,
    const std::vector<SurfacePoint>& points, const VertexMap& user_map,
    const std::stop_token& stop) {
  std::vector<PrecisePoint> precise(user_map.size());
  const auto n = static_cast<VertexIndex>(user_map.size());
  ISOMATCH_RETURN_IF_ERROR(ParallelForVertices(n, stop, [&](VertexIndex u) {
    const VertexIndex v = x.working_from_user[u];
    const VertexIndex image = user_map[u];
    if (v == kNoVertex || image == kNoVertex) return;
    if (points.empty()) {
      precise[u] = {{image, image, image}, {1, 0, 0}};
      return;
    }
    for (int corner = 0; corner < 3; ++corner) {
      precise[u].vertices[corner] =
          y.user_from_working[y.mesh.faces(points[v].face, corner)];
      precise[u].weights[corner] = points[v].weights[corner];
    }
  }));
  return precise;
}

}  // namespace isomatch
