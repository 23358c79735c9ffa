#include "core/geodesic/rim_distance.h"

#include "absl/types/span.h"
#include "core/mesh/topology.h"

namespace isomatch {

std::vector<float> RimDistances(const TriangleMesh& mesh,
                                const DistanceFieldSolver& solver) {
  const std::vector<char> is_on_rim = RimVertices(mesh, EdgeFaces(mesh.faces));
  std::vector<float> distances(mesh.num_vertices(), kUnreachable);
  DistanceFieldSolver::Workspace workspace;
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    if (is_on_rim[v]) solver.Lower(v, absl::MakeSpan(distances), &workspace);
  }
  return distances;
}

}  // namespace isomatch
