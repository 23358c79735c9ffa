#include "core/evaluation/area_stretch.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <limits>

#include <Eigen/Geometry>

#include "core/mesh/clean_mesh.h"
#include "core/mesh/mesh_geometry.h"
#include "core/mesh/vertex_stars.h"

namespace isomatch {
namespace {

constexpr double kLargestRatio = 1000;
constexpr int kMostRounds = 64;

/// A walk of r rounds gets sqrt(r) edges far.
constexpr double kReachInEdgesOfY = 1.5;

/// n x 2: of the faces at each vertex the sum of areas on X, and of signed
/// areas of their images, in parts of the whole.
using Areas = Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::RowMajor>;

/// The map between cleaned meshes, whose faces agree in orientation.
VertexMap CleanMap(const CleanMesh& x, const CleanMesh& y,
                   absl::Span<const VertexIndex> y_from_x) {
  VertexMap map;
  map.reserve(x.original_from_clean.size());
  for (const VertexIndex original : x.original_from_clean) {
    const VertexIndex image = y_from_x[original];
    map.push_back(image == kNoVertex ? kNoVertex
                                     : y.clean_from_original[image]);
  }
  return map;
}

/// Area of the triangle between three vertices of Y, negative when it turns
/// against Y's normals there.
double SignedArea(const TriangleMesh& mesh_y, const Positions& normals_y,
                  VertexIndex a, VertexIndex b, VertexIndex c) {
  const Eigen::RowVector3d ab =
      mesh_y.positions.row(b) - mesh_y.positions.row(a);
  const Eigen::RowVector3d ac =
      mesh_y.positions.row(c) - mesh_y.positions.row(a);
  const Eigen::RowVector3d normal =
      normals_y.row(a) + normals_y.row(b) + normals_y.row(c);
  const Eigen::RowVector3d doubled_area = ab.cross(ac);
  return std::copysign(0.5 * doubled_area.norm(), doubled_area.dot(normal));
}

Areas StarAreas(const TriangleMesh& mesh_x, const TriangleMesh& mesh_y,
                absl::Span<const VertexIndex> y_from_x) {
  const Positions normals_y = VertexNormals(mesh_y);
  const double whole_x = SurfaceArea(mesh_x);
  const double whole_y = SurfaceArea(mesh_y);
  Areas areas = Areas::Zero(mesh_x.num_vertices(), 2);
  for (VertexIndex f = 0; f < mesh_x.num_faces(); ++f) {
    const auto corners = mesh_x.faces.row(f);
    const VertexIndex a = y_from_x[corners[0]];
    const VertexIndex b = y_from_x[corners[1]];
    const VertexIndex c = y_from_x[corners[2]];
    if (a == kNoVertex || b == kNoVertex || c == kNoVertex) continue;
    const Eigen::RowVector2d area(
        FaceArea(mesh_x, f) / whole_x,
        SignedArea(mesh_y, normals_y, a, b, c) / whole_y);
    for (const VertexIndex v : corners) areas.row(v) += area;
  }
  return areas;
}

Areas Averaged(const Areas& areas, const VertexStars& stars) {
  Areas averaged = areas;
  for (Eigen::Index v = 0; v < areas.rows(); ++v) {
    const auto neighbors = stars.Neighbors(static_cast<VertexIndex>(v));
    for (const VertexIndex w : neighbors) averaged.row(v) += areas.row(w);
    averaged.row(v) /= 1.0 + static_cast<double>(neighbors.size());
  }
  return averaged;
}

int Rounds(const TriangleMesh& mesh_x, const TriangleMesh& mesh_y) {
  const double edge_x = MeanEdgeLength(mesh_x) / std::sqrt(SurfaceArea(mesh_x));
  const double edge_y = MeanEdgeLength(mesh_y) / std::sqrt(SurfaceArea(mesh_y));
  const double edges = kReachInEdgesOfY * edge_y / edge_x;
  return static_cast<int>(
      std::clamp(std::ceil(edges * edges), 1.0, double{kMostRounds}));
}

/// NaN where nothing was measured.
float LogRatio(const Eigen::RowVector2d& areas) {
  if (!(areas[0] > 0)) return std::numeric_limits<float>::quiet_NaN();
  const double ratio = std::clamp(std::abs(areas[1]) / areas[0],
                                  1 / kLargestRatio, kLargestRatio);
  return static_cast<float>(std::log(ratio));
}

}  // namespace

std::vector<float> LogAreaStretch(const TriangleMesh& mesh_x,
                                  const TriangleMesh& mesh_y,
                                  absl::Span<const VertexIndex> y_from_x) {
  assert(static_cast<VertexIndex>(y_from_x.size()) == mesh_x.num_vertices());
  const CleanMesh x = Clean(mesh_x);
  const CleanMesh y = Clean(mesh_y);
  const VertexStars stars(x.mesh);
  Areas areas = StarAreas(x.mesh, y.mesh, CleanMap(x, y, y_from_x));
  const int rounds = Rounds(x.mesh, y.mesh);
  for (int round = 0; round < rounds; ++round) areas = Averaged(areas, stars);
  std::vector<float> stretch(y_from_x.size(),
                             std::numeric_limits<float>::quiet_NaN());
  for (std::size_t v = 0; v < stretch.size(); ++v) {
    const VertexIndex clean = x.clean_from_original[v];
    if (y_from_x[v] == kNoVertex || clean == kNoVertex) continue;
    stretch[v] = LogRatio(areas.row(clean));
  }
  return stretch;
}

}  // namespace isomatch
