#include "core/geodesic/rim_distance.h"

#include "absl/types/span.h"
#include "core/mesh/topology.h"

namespace isomatch {

std::vector<float> RimDistances(const TriangleMesh& mesh,
                                const DistanceFieldSolver& solver) {
  const EdgeFaces edges(mesh.faces);
  std::vector<char> is_on_rim(mesh.num_vertices(), false);
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    for (int corner = 0; corner < 3; ++corner) {
      if (!edges.IsBoundary(f, corner)) continue;
      is_on_rim[mesh.faces(f, corner)] = true;
      is_on_rim[mesh.faces(f, (corner + 1) % 3)] = true;
    }
  }
  std::vector<float> distances(mesh.num_vertices(), kUnreachable);
  DistanceFieldSolver::Workspace workspace;
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    if (is_on_rim[v]) solver.Lower(v, absl::MakeSpan(distances), &workspace);
  }
  return distances;
}

}  // namespace isomatch
