#include "core/mesh/triangle_mesh.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/mesh/mesh_geometry.h"

namespace isomatch {
namespace {

absl::Status CheckPositions(const Positions& positions,
                            const std::string& field) {
  for (Eigen::Index v = 0; v < positions.rows(); ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      const double value = positions(v, axis);
      if (std::isfinite(value)) continue;
      return absl::InvalidArgumentError(
          absl::StrCat(field, ": coordinate ", axis, " of vertex ", v, " is ",
                       value, ", expected a finite number"));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckFaces(const TriangleMesh& mesh, const std::string& field) {
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    for (int corner = 0; corner < 3; ++corner) {
      const VertexIndex v = mesh.faces(f, corner);
      if (v >= 0 && v < mesh.num_vertices()) continue;
      return absl::InvalidArgumentError(
          absl::StrCat(field, ": face ", f, " names vertex ", v,
                       ", expected 0 to ", mesh.num_vertices() - 1));
    }
  }
  return absl::OkStatus();
}

/// What EdgeFaces and VertexStars can number: six neighbors a face at most.
constexpr VertexIndex kMostFaces = std::numeric_limits<VertexIndex>::max() / 6;
/// Faces that medians are taken over, at even steps.
constexpr VertexIndex kSampledFaces = 1 << 12;

/// Single precision, in which descriptors and distances are kept, holds seven
/// digits: from further away an edge is a point.
constexpr double kMostEdges = 1e7;
/// Coordinates are divided by sqrt(area): their fourth powers stay finite in
/// single precision.
constexpr double kMostRootAreas = 1e6;
/// Fourth powers of lengths stay finite, and above zero, in double precision.
constexpr double kLongest = 1e70;
constexpr double kShortest = 1e-70;
constexpr double kLeastArea = std::numeric_limits<double>::min();

double MedianOf(std::vector<double>* values) {
  const auto middle = values->begin() + std::ssize(*values) / 2;
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

/// What a mesh is measured by, insensitive to a few bad vertices: medians over
/// some faces.
struct Measures {
  Eigen::RowVector3d middle;
  double edge;      ///< of those that have a length; 0 for none
  double area = 0;  ///< of those faces together
};

Measures MeasuresOf(const TriangleMesh& mesh) {
  const VertexIndex step = 1 + (mesh.num_faces() - 1) / kSampledFaces;
  std::vector<double> edges;
  std::vector<double> coordinates[3];
  Measures measures;
  for (VertexIndex f = 0; f < mesh.num_faces(); f += step) {
    measures.area += FaceArea(mesh, f);
    for (int corner = 0; corner < 3; ++corner) {
      const auto from = mesh.positions.row(mesh.faces(f, corner));
      const auto to = mesh.positions.row(mesh.faces(f, (corner + 1) % 3));
      const double length = (to - from).norm();
      if (length > 0) edges.push_back(length);
      for (int axis = 0; axis < 3; ++axis) {
        coordinates[axis].push_back(from[axis]);
      }
    }
  }
  for (int axis = 0; axis < 3; ++axis) {
    measures.middle[axis] = MedianOf(&coordinates[axis]);
  }
  measures.edge = edges.empty() ? 0 : MedianOf(&edges);
  return measures;
}

/// The vertex that lies farthest from a point, and how far.
struct Farthest {
  VertexIndex vertex = 0;
  double distance = 0;
};

/// Of the vertices that `is_counted` says, of all where it is empty.
Farthest FarthestFrom(const TriangleMesh& mesh,
                      const Eigen::RowVector3d& middle,
                      const std::vector<bool>& is_counted) {
  Farthest farthest;
  double most = 0;  // squared
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    const double squared = (mesh.positions.row(v) - middle).squaredNorm();
    if (squared <= most) continue;  // infinite is farthest
    if (!is_counted.empty() && !is_counted[v]) continue;
    farthest = {v, std::sqrt(most = squared)};
  }
  return farthest;
}

/// That the core's numbers hold the shape.
absl::Status CheckProportions(const TriangleMesh& mesh,
                              const std::string& field) {
  const Measures measures = MeasuresOf(mesh);
  // What holds with the vertices on no face, and by the area of some faces,
  // holds without these and by that of all, and takes no look at all faces.
  // Some vertex lies half an edge away at least.
  const double reach = FarthestFrom(mesh, measures.middle, {}).distance;
  if (reach < kLongest && measures.edge > 2 * kShortest &&
      measures.area > kLeastArea && reach <= kMostEdges * measures.edge &&
      reach <= kMostRootAreas * std::sqrt(measures.area)) {
    return absl::OkStatus();
  }
  const double area = SurfaceArea(mesh);
  if (!(area > kLeastArea) || !std::isfinite(area)) {
    return absl::InvalidArgumentError(
        absl::StrCat(field, ": surface area is ", area,
                     ", expected a positive, finite area"));
  }
  const double root_area = std::sqrt(area);
  const Farthest farthest =
      FarthestFrom(mesh, measures.middle, VerticesOnFaces(mesh));
  const auto too_far = [&](double ratio, const char* unit, double most) {
    return absl::InvalidArgumentError(
        absl::StrCat(field, ": vertex ", farthest.vertex, " lies ", ratio, " ",
                     unit, " from the middle of the others, expected at most ",
                     most, "; move or remove it"));
  };
  if (!(farthest.distance < kLongest && farthest.distance > kShortest)) {
    return too_far(farthest.distance, "units", kLongest);
  }
  if (!(farthest.distance <= kMostEdges * measures.edge)) {
    return too_far(farthest.distance / measures.edge, "median edges",
                   kMostEdges);
  }
  if (!(farthest.distance <= kMostRootAreas * root_area)) {
    return too_far(farthest.distance / root_area,
                   "times the square root of the surface area", kMostRootAreas);
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status ValidateMesh(const TriangleMesh& mesh, const std::string& field) {
  if (mesh.num_vertices() < 3 || mesh.num_faces() < 1) {
    return absl::InvalidArgumentError(
        absl::StrCat(field, ": ", mesh.num_vertices(), " vertices and ",
                     mesh.num_faces(), " faces, expected at least one face"));
  }
  if (mesh.num_faces() > kMostFaces) {
    return absl::InvalidArgumentError(
        absl::StrCat(field, ": ", mesh.num_faces(), " faces, expected at most ",
                     kMostFaces));
  }
  ISOMATCH_RETURN_IF_ERROR(CheckPositions(mesh.positions, field));
  ISOMATCH_RETURN_IF_ERROR(CheckFaces(mesh, field));
  return CheckProportions(mesh, field);
}

}  // namespace isomatch
