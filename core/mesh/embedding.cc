#include "core/mesh/embedding.h"

#include "core/base/parallel.h"
#include "core/base/status_macros.h"
#include "core/mesh/surface_samples.h"

namespace isomatch {

Embedding EmbedInItself(const StarredMesh& surface) {
  Embedding embedding = {surface.mesh.faces, {}};
  for (VertexIndex v = 0; v < surface.mesh.num_vertices(); ++v) {
    SurfacePoint point = {surface.stars.Faces(v).front()};
    for (int corner = 0; corner < 3; ++corner) {
      point.weights[corner] = surface.mesh.faces(point.face, corner) == v;
    }
    embedding.points.push_back(point);
  }
  return embedding;
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

absl::StatusOr<Embedding> EmbedInCoarse(const StarredMesh& fine,
                                        const CoarseSurface& surface,
                                        const VertexMap& starts,
                                        const std::stop_token& stop) {
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
  Embedding embedding;
  embedding.points.resize(n);
  ISOMATCH_RETURN_IF_ERROR(ParallelForVertices(n, stop, [&](VertexIndex v) {
    const VertexIndex nearest = DescendOverEdges(from, to, v, starts[v], {});
    // The nearest vertex need not be a corner of the nearest face.
    std::vector<VertexIndex> around;
    for (const VertexIndex c : surface.stars.SomeNeighbors(nearest)) {
      const auto faces = surface.stars.SomeFaces(c);
      around.insert(around.end(), faces.begin(), faces.end());
    }
    embedding.points[v] =
        NearestOnFaces(coarse, around, fine.mesh.positions.row(v));
  }));
  embedding.faces = surface.faces;
  for (Eigen::Index i = 0; i < embedding.faces.size(); ++i) {
    embedding.faces.data()[i] =
        surface.fine_from_coarse[embedding.faces.data()[i]];
  }
  return embedding;
}

}  // namespace isomatch
