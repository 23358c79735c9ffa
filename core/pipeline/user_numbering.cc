#include "core/pipeline/user_numbering.h"

namespace isomatch {

VertexMap ToUserMap(const WorkingMesh& x, const WorkingMesh& y,
                    const VertexMap& y_from_x) {
  VertexMap user_map;
  for (const VertexIndex v : x.working_from_user) {
    const VertexIndex image = v == kNoVertex ? kNoVertex : y_from_x[v];
    user_map.push_back(image == kNoVertex ? kNoVertex
                                          : y.user_from_working[image]);
  }
  return user_map;
}

std::vector<PrecisePoint> ToUserPoints(const WorkingMesh& x,
                                       const WorkingMesh& y,
                                       const std::vector<SurfacePoint>& points,
                                       const VertexMap& user_map) {
  std::vector<PrecisePoint> precise(user_map.size());
  for (std::size_t u = 0; u < user_map.size(); ++u) {
    const VertexIndex v = x.working_from_user[u];
    const VertexIndex image = user_map[u];
    if (v == kNoVertex || image == kNoVertex) continue;
    if (points.empty()) {
      precise[u] = {{image, image, image}, {1, 0, 0}};
      continue;
    }
    for (int corner = 0; corner < 3; ++corner) {
      precise[u].vertices[corner] =
          y.user_from_working[y.mesh.faces(points[v].face, corner)];
      precise[u].weights[corner] = points[v].weights[corner];
    }
  }
  return precise;
}

}  // namespace isomatch
