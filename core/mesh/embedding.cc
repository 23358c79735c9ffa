#include "core/mesh/embedding.h"

#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/base/parallel.h"
#include "core/base/sorted_buckets.h"
#include "core/base/status_macros.h"
#include "core/mesh/face_lanes.h"
#include "core/mesh/surface_samples.h"

namespace isomatch {
namespace {

/// The faces of a vertex and of its neighbors, of which the face that is
/// nearest to a point is one where the vertex is nearest, in all likelihood.
std::vector<VertexIndex> FacesAround(const VertexStars& stars,
                                     VertexIndex vertex) {
  std::vector<VertexIndex> around;
  for (const VertexIndex v : stars.SomeNeighbors(vertex)) {
    const auto faces = stars.SomeFaces(v);
    around.insert(around.end(), faces.begin(), faces.end());
  }
  std::sort(around.begin(), around.end());
  around.erase(std::unique(around.begin(), around.end()), around.end());
  return around;
}

}  // namespace

std::vector<SurfacePoint> EmbedInItself(const StarredMesh& surface) {
  std::vector<SurfacePoint> points;
  for (VertexIndex v = 0; v < surface.mesh.num_vertices(); ++v) {
    SurfacePoint point = {surface.stars.Faces(v).front()};
    for (int corner = 0; corner < 3; ++corner) {
      point.weights[corner] = surface.mesh.faces(point.face, corner) == v;
    }
    points.push_back(point);
  }
  return points;
}

VertexMap NearestByEdges(const VertexStars& fine_stars, VertexIndex num_fine,
                         const VertexMap& fine_from_coarse) {
  VertexMap nearest(num_fine, kNoVertex);
  VertexMap reached = fine_from_coarse;
  for (std::size_t c = 0; c < fine_from_coarse.size(); ++c) {
    nearest[fine_from_coarse[c]] = static_cast<VertexIndex>(c);
  }
  for (std::size_t i = 0; i < reached.size(); ++i) {
    for (const VertexIndex v : fine_stars.Neighbors(reached[i])) {
      if (nearest[v] != kNoVertex) continue;
      nearest[v] = nearest[reached[i]];
      reached.push_back(v);
    }
  }
  return nearest;
}

absl::StatusOr<std::vector<SurfacePoint>> EmbedInCoarse(
    const StarredMesh& fine, const CoarseSurface& surface,
    const VertexMap& starts, const std::stop_token& stop) {
  const VertexIndex n = fine.mesh.num_vertices();
  const TriangleMesh coarse = {
      fine.mesh.positions(surface.fine_from_coarse, Eigen::all), surface.faces};
  const PointColumns fine_columns =
      fine.mesh.positions.transpose().cast<float>();
  const PointColumns coarse_columns =
      coarse.positions.transpose().cast<float>();
  const Eigen::VectorXd no_areas;
  const PointsOnSurface from = {fine.stars, no_areas, fine_columns};
  const PointsOnSurface to = {surface.stars, no_areas, coarse_columns};
  VertexMap nearest(n);
  ISOMATCH_RETURN_IF_ERROR(ParallelForVertices(n, stop, [&](VertexIndex v) {
    nearest[v] = DescendOverEdges(from, to, v, starts[v], {});
  }));
  const SortedBuckets<VertexIndex> fine_of_coarse(
      n, coarse.num_vertices(), [&](std::int64_t v) { return nearest[v]; },
      [](std::int64_t v) { return static_cast<VertexIndex>(v); });
  std::vector<SurfacePoint> points(n);
  const auto embed_around = [&](VertexIndex c) {
    if (fine_of_coarse[c].empty()) return;
    const std::vector<VertexIndex> around = FacesAround(surface.stars, c);
    const FaceLanes faces(coarse, around, c);
    for (const VertexIndex v : fine_of_coarse[c]) {
      points[v] = faces.Nearest(fine.mesh.positions.row(v));
    }
  };
  ISOMATCH_RETURN_IF_ERROR(
      ParallelForVertices(coarse.num_vertices(), stop, embed_around));
  return points;
}

}  // namespace isomatch
