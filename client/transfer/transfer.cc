#include "client/transfer/transfer.h"

#include <algorithm>
#include <cstddef>

#include "client/files/mesh_file.h"
#include "core/base/parallel.h"
#include "core/base/status_macros.h"
#include "core/geodesic/distance_field_solver.h"
#include "core/mesh/clean_mesh.h"
#include "core/mesh/surface_point.h"

namespace isomatch {
namespace {

bool IsNowhere(const PrecisePoint& place) {
  return place.vertices[0] == kNoVertex;
}

// Returns the mean, by weight, of value_of(v) over the place's vertices. A
// weight of 1 gives the value itself. REQUIRES: `sum` is zero.
template <typename Value, typename ValueOf>
Value Mean(const PrecisePoint& place, Value sum, const ValueOf& value_of) {
  for (std::size_t i = 0; i < 3; ++i) {
    if (place.weights[i] == 0) continue;
    sum += place.weights[i] * value_of(place.vertices[i]);
  }
  return sum;
}

// Returns the one of `vertices` that is nearest to their mean position, the
// first of equal ones.
VertexIndex Middle(const Positions& positions,
                   absl::Span<const VertexIndex> vertices) {
  Eigen::RowVector3d middle = Eigen::RowVector3d::Zero();
  for (const VertexIndex v : vertices) {
    middle += positions.row(v) / static_cast<double>(vertices.size());
  }
  return *std::min_element(vertices.begin(), vertices.end(),
                           [&](VertexIndex a, VertexIndex b) {
                             return (positions.row(a) - middle).squaredNorm() <
                                    (positions.row(b) - middle).squaredNorm();
                           });
}

// Returns the vertex of X that lies nearest to a landmark of Y. `field` has the
// distance of each vertex of the cleaned Y from that landmark.
CarriedLandmark Nearest(absl::Span<const float> field, const CleanMesh& clean_y,
                        const Positions& positions_x,
                        absl::Span<const PrecisePoint> places) {
  double least = kUnreachable;
  std::vector<VertexIndex> nearest;
  for (std::size_t x = 0; x < places.size(); ++x) {
    if (IsNowhere(places[x])) continue;
    const double distance = Mean(places[x], 0.0, [&](VertexIndex y) {
      const VertexIndex clean = clean_y.clean_from_original[y];
      return clean == kNoVertex ? double{kUnreachable} : double{field[clean]};
    });
    if (distance > least) continue;
    if (distance < least) nearest.clear();
    least = distance;
    nearest.push_back(static_cast<VertexIndex>(x));
  }
  // A mean of unreachable distances may be rounded to less than kUnreachable,
  // but not to less than half of it.
  if (nearest.empty() || least >= kUnreachable / 2) return {};
  return {Middle(positions_x, nearest), least};
}

}  // namespace

int CountUnmatched(absl::Span<const PrecisePoint> places) {
  return static_cast<int>(
      std::count_if(places.begin(), places.end(), IsNowhere));
}

Colors CarryColors(const Colors& colors_y,
                   absl::Span<const PrecisePoint> places) {
  Colors colors(static_cast<Eigen::Index>(places.size()), 3);
  for (std::size_t x = 0; x < places.size(); ++x) {
    const auto row = static_cast<Eigen::Index>(x);
    if (IsNowhere(places[x])) {
      colors.row(row) = kNoColor;
      continue;
    }
    colors.row(row) =
        Mean(places[x], Eigen::RowVector3d::Zero().eval(),
             [&](VertexIndex y) { return colors_y.row(y).eval(); });
  }
  return colors;
}

std::vector<std::int64_t> CarryLabels(absl::Span<const std::int64_t> labels_y,
                                      absl::Span<const PrecisePoint> places,
                                      std::int64_t missing) {
  std::vector<std::int64_t> labels;
  labels.reserve(places.size());
  for (const PrecisePoint& place : places) {
    const auto heaviest = static_cast<std::size_t>(
        std::max_element(place.weights.begin(), place.weights.end()) -
        place.weights.begin());
    labels.push_back(
        IsNowhere(place)
            ? missing
            : labels_y[static_cast<std::size_t>(place.vertices[heaviest])]);
  }
  return labels;
}

absl::StatusOr<std::vector<CarriedLandmark>> CarryLandmarks(
    absl::Span<const VertexIndex> landmarks_y, const TriangleMesh& mesh_x,
    const TriangleMesh& mesh_y, absl::Span<const PrecisePoint> places,
    const std::stop_token& stop) {
  const CleanMesh clean_y = Clean(AsSent(mesh_y));
  const DistanceFieldSolver solver(clean_y.mesh);
  std::vector<CarriedLandmark> carried(landmarks_y.size());
  const auto count = static_cast<std::int64_t>(landmarks_y.size());
  ISOMATCH_RETURN_IF_ERROR(ParallelFor(count, stop, [&](std::int64_t i) {
    const VertexIndex source = clean_y.clean_from_original[landmarks_y[i]];
    if (source == kNoVertex) return;  // only on faces that cleaning drops
    DistanceFieldSolver::Workspace workspace;
    std::vector<float> field(static_cast<std::size_t>(solver.num_vertices()));
    solver.Solve(source, field.data(), 1, &workspace);
    carried[i] = Nearest(field, clean_y, mesh_x.positions, places);
  }));
  return carried;
}

namespace {

// Faces with a vertex that `is_wanted`.
std::vector<VertexIndex> FacesOf(const Faces& faces,
                                 const std::vector<bool>& is_wanted) {
  std::vector<VertexIndex> found;
  for (VertexIndex f = 0; f < static_cast<VertexIndex>(faces.rows()); ++f) {
    for (int i = 0; i < 3; ++i) {
      if (!is_wanted[static_cast<std::size_t>(faces(f, i))]) continue;
      found.push_back(f);
      break;
    }
  }
  return found;
}

}  // namespace

Eigen::RowVector3d PointOnX(const Eigen::RowVector3d& position_y, VertexIndex x,
                            const TriangleMesh& mesh_x,
                            const TriangleMesh& mesh_y,
                            absl::Span<const PrecisePoint> places) {
  std::vector<bool> is_near(places.size());
  is_near[static_cast<std::size_t>(x)] = true;
  for (const VertexIndex f : FacesOf(mesh_x.faces, is_near)) {
    for (int i = 0; i < 3; ++i) {
      is_near[static_cast<std::size_t>(mesh_x.faces(f, i))] = true;
    }
  }
  TriangleMesh image = {Positions::Zero(mesh_x.num_vertices(), 3),
                        mesh_x.faces};
  std::vector<VertexIndex> near;
  for (const VertexIndex f : FacesOf(mesh_x.faces, is_near)) {
    bool has_image = true;
    for (int i = 0; i < 3 && has_image; ++i) {
      const VertexIndex v = mesh_x.faces(f, i);
      const PrecisePoint& place = places[static_cast<std::size_t>(v)];
      has_image = !IsNowhere(place);
      if (!has_image) break;
      image.positions.row(v) =
          Mean(place, Eigen::RowVector3d::Zero().eval(),
               [&](VertexIndex y) { return mesh_y.positions.row(y).eval(); });
    }
    if (has_image) near.push_back(f);
  }
  if (near.empty()) return mesh_x.positions.row(x);
  return PositionOf(mesh_x, NearestOnFaces(image, near, position_y));
}

}  // namespace isomatch
