#include "core/geodesic/farthest_point_sampling.h"

#include <algorithm>

#include "core/base/parallel.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

VertexIndex Farthest(const std::vector<float>& distances) {
  return static_cast<VertexIndex>(
      std::max_element(distances.begin(), distances.end()) - distances.begin());
}

/// Farthest reachable vertex from `source`.
VertexIndex FarthestFrom(const DistanceFieldSolver& solver, VertexIndex source,
                         DistanceFieldSolver::Workspace* workspace) {
  std::vector<float> field(solver.num_vertices());
  solver.Solve(source, field.data(), 1, workspace);
  for (float& distance : field) {
    if (distance == kUnreachable) distance = 0;
  }
  return Farthest(field);
}

}  // namespace

absl::StatusOr<std::vector<VertexIndex>> FarthestPoints(
    const DistanceFieldSolver& solver, int count, const std::stop_token& stop) {
  DistanceFieldSolver::Workspace workspace;
  const VertexIndex end = FarthestFrom(solver, 0, &workspace);
  VertexIndex next = FarthestFrom(solver, end, &workspace);
  std::vector<float> nearest(solver.num_vertices(), kUnreachable);
  std::vector<VertexIndex> points;
  const int wanted = std::min<int>(count, solver.num_vertices());
  points.reserve(wanted);
  while (static_cast<int>(points.size()) < wanted) {
    ISOMATCH_RETURN_IF_ERROR(CheckNotCancelled(stop));
    points.push_back(next);
    solver.Lower(next, absl::MakeSpan(nearest), &workspace);
    // Below any distance, so that no point comes twice.
    nearest[next] = -1;
    next = Farthest(nearest);
  }
  return points;
}

}  // namespace isomatch
