#include "core/pipeline/lifting.h"

#include <algorithm>
#include <cmath>

#include "core/base/parallel.h"
#include "core/base/status_macros.h"
#include "core/mesh/connected_ball.h"
#include "core/mesh/embedding.h"
#include "core/mesh/mesh_geometry.h"
#include "core/mesh/surface_samples.h"

namespace isomatch {
namespace {

/// What unit normals are multiplied by, beside positions in sqrt(area): enough
/// to tell the sides of a thin wall apart. More would let the noise of normals
/// choose the vertex.
constexpr float kNormalWeight = 0.01f;
/// How far around a landmark vertices move with it, in mean edges of the solved
/// mesh: that far the map cannot have known of it.
constexpr double kLandmarkReach = 3;

/// Positions and weighted normals, one vertex a column.
PointColumns Describe(const Positions& positions, const Positions& normals) {
  PointColumns columns(6, positions.rows());
  columns.topRows(3) = positions.transpose().cast<float>();
  columns.bottomRows(3) = kNormalWeight * normals.transpose().cast<float>();
  return columns;
}

PointColumns Describe(const Positions& positions) {
  return positions.transpose().cast<float>();
}

/// The full vertices of a solved mesh.
VertexIndex ToFull(const PreparedMesh& shape, VertexIndex solved) {
  return shape.coarse ? shape.coarse->full_from_coarse[solved] : solved;
}

/// Where the solved vertices of X go, and the full vertex of Y next to that.
struct Images {
  Positions places;
  VertexMap vertices;
};

Images ImagesOf(const PreparedMesh& y,
                const std::vector<SurfacePoint>& points) {
  const auto n = static_cast<Eigen::Index>(points.size());
  Images images = {Positions::Zero(n, 3), VertexMap(points.size())};
  const Faces& faces = y.solved().mesh.faces;
  for (std::size_t c = 0; c < points.size(); ++c) {
    for (int corner = 0; corner < 3; ++corner) {
      images.places.row(static_cast<Eigen::Index>(c)) +=
          points[c].weights[corner] *
          y.full.mesh.positions.row(ToFull(y, faces(points[c].face, corner)));
    }
    images.vertices[c] = ToFull(y, NearestCorner(faces, points[c]));
  }
  return images;
}

/// Moves what lies around the landmarks with them.
absl::Status FollowLandmarks(const PreparedMesh& x, const PreparedMesh& y,
                             absl::Span<const VertexMatch> landmarks,
                             const std::stop_token& stop, Positions* places) {
  if (landmarks.empty()) return absl::OkStatus();
  // Edges of the solved mesh in the unit of the full one.
  const double unit = x.coarse ? std::sqrt(x.coarse->working.area) : 1;
  const double reach = kLandmarkReach * unit * MeanEdgeLength(x.solved().mesh);
  const Eigen::Matrix4Xf rest = BallPositions(x.full.mesh.positions);
  ConnectedBall ball(rest, x.full.stars);
  Positions moves = Positions::Zero(places->rows(), 3);
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(places->rows());
  for (const VertexMatch& landmark : landmarks) {
    ISOMATCH_RETURN_IF_ERROR(CheckNotCancelled(stop));
    const Eigen::RowVector3d move =
        y.full.mesh.positions.row(landmark.y) - places->row(landmark.x);
    for (const auto& [vertex, distance] : ball.Around(landmark.x, reach)) {
      const double away = distance / reach;
      // Next to a landmark nothing else counts; at the reach it does not.
      constexpr double kTiny = 1e-6;
      const double weight = (1 - away) * (1 - away) / (away * away + kTiny);
      moves.row(vertex) += weight * move;
      weights[vertex] += weight;
    }
  }
  // Between landmarks their mean, further out ever less.
  for (Eigen::Index v = 0; v < places->rows(); ++v) {
    places->row(v) += moves.row(v) / std::max(weights[v], 1.0);
  }
  return absl::OkStatus();
}

/// Where X's full mesh lies on that of Y. `places`: of the solved vertices.
absl::StatusOr<Positions> LayOut(const PreparedMesh& x,
                                 const std::vector<SurfacePoint>& embedding,
                                 const Positions& places,
                                 const std::stop_token& stop) {
  const Faces& faces = x.solved().mesh.faces;
  const Positions& all = x.full.mesh.positions;
  const Positions rest =
      x.coarse ? Positions(all(x.coarse->full_from_coarse, Eigen::all)) : all;
  const Positions normals = VertexNormals(rest, faces);
  const Positions laid_normals = VertexNormals(places, faces);
  Positions laid_out(all.rows(), 3);
  ISOMATCH_RETURN_IF_ERROR(
      ParallelForVertices(x.full.mesh.num_vertices(), stop, [&](VertexIndex v) {
        const SurfacePoint& point = embedding[v];
        const Eigen::RowVector3d beside =
            all.row(v) - Interpolated(rest, faces, point);
        const double height = beside.dot(Interpolated(normals, faces, point));
        laid_out.row(v) = Interpolated(places, faces, point) +
                          height * Interpolated(laid_normals, faces, point);
      }));
  return laid_out;
}

/// The vertex of Y nearest to each of X as it is laid out, from where the
/// corner of its coarse face went.
absl::StatusOr<VertexMap> NearestToLaidOut(const PreparedMesh& x,
                                           const PreparedMesh& y,
                                           const Positions& laid_out,
                                           const VertexMap& starts,
                                           const std::stop_token& stop) {
  // Normals only where they mean something.
  const bool oriented = x.full.oriented && y.full.oriented;
  const PointColumns columns_x =
      oriented ? Describe(laid_out, VertexNormals(laid_out, x.full.mesh.faces))
               : Describe(laid_out);
  const PointColumns columns_y =
      oriented ? Describe(y.full.mesh.positions, y.full.normals)
               : Describe(y.full.mesh.positions);
  const Eigen::VectorXd no_areas;
  const PointsOnSurface from = {x.full.stars, no_areas, columns_x};
  const PointsOnSurface to = {y.full.stars, no_areas, columns_y};
  VertexMap before(starts.size());
  const auto n = static_cast<VertexIndex>(starts.size());
  ISOMATCH_RETURN_IF_ERROR(ParallelForVertices(n, stop, [&](VertexIndex v) {
    before[v] = DescendOverEdges(from, to, v, starts[v], {});
  }));
  return DescendFromMap(from, to, before, stop);
}

}  // namespace

std::vector<SurfacePoint> PointsAtVertices(const WorkingMesh& mesh,
                                           const VertexMap& vertices) {
  const std::vector<SurfacePoint> itself =
      EmbedInItself({mesh.mesh, mesh.stars});
  std::vector<SurfacePoint> points;
  for (const VertexIndex v : vertices) points.push_back(itself[v]);
  return points;
}

absl::StatusOr<LiftedMap> LiftMap(const PreparedMesh& x, const PreparedMesh& y,
                                  const std::vector<SurfacePoint>& points,
                                  absl::Span<const VertexMatch> landmarks,
                                  const std::stop_token& stop) {
  const VertexIndex n = x.full.mesh.num_vertices();
  const StarredMesh full_x = {x.full.mesh, x.full.stars};
  const std::vector<SurfacePoint> itself =
      x.coarse ? std::vector<SurfacePoint>() : EmbedInItself(full_x);
  const std::vector<SurfacePoint>& embedding =
      x.coarse ? x.coarse->embedding : itself;
  const Images images = ImagesOf(y, points);
  ISOMATCH_ASSIGN_OR_RETURN(Positions laid_out,
                            LayOut(x, embedding, images.places, stop));
  ISOMATCH_RETURN_IF_ERROR(FollowLandmarks(x, y, landmarks, stop, &laid_out));
  VertexMap starts(n);
  for (VertexIndex v = 0; v < n; ++v) {
    starts[v] =
        images.vertices[NearestCorner(x.solved().mesh.faces, embedding[v])];
  }
  LiftedMap lifted;
  ISOMATCH_ASSIGN_OR_RETURN(lifted.y_from_x,
                            NearestToLaidOut(x, y, laid_out, starts, stop));
  lifted.points.resize(n);
  ISOMATCH_RETURN_IF_ERROR(ParallelForVertices(n, stop, [&](VertexIndex v) {
    lifted.points[v] =
        NearestOnFaces(y.full.mesh, y.full.stars.SomeFaces(lifted.y_from_x[v]),
                       laid_out.row(v));
  }));
  return lifted;
}

}  // namespace isomatch
