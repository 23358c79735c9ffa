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

/// Where the vertices of clean X go, and the normals of clean Y there.
struct Images {
  std::vector<bool> is_there;
  Positions places;
  Positions normals;
};

/// `is_there(v)` tells whether vertex v of the file has an image, `of(values,
/// v)` what the vertices of clean Y have in `values` there.
template <typename IsThere, typename Of>
Images CleanImages(const CleanMesh& x, const CleanMesh& y,
                   const IsThere& is_there, const Of& of) {
  const Positions normals_y = VertexNormals(y.mesh);
  const VertexIndex vertices = x.mesh.num_vertices();
  Images images = {std::vector<bool>(vertices), Positions::Zero(vertices, 3),
                   Positions::Zero(vertices, 3)};
  for (VertexIndex v = 0; v < vertices; ++v) {
    const VertexIndex original = x.original_from_clean[v];
    if (!is_there(original)) continue;
    images.is_there[v] = true;
    images.places.row(v) = of(y.mesh.positions, original);
    images.normals.row(v) = of(normals_y, original);
  }
  return images;
}

/// Area of the triangle between the images of three vertices of X, negative
/// when it turns against Y's normals there.
double SignedArea(const Images& images, VertexIndex a, VertexIndex b,
                  VertexIndex c) {
  const Eigen::RowVector3d ab = images.places.row(b) - images.places.row(a);
  const Eigen::RowVector3d ac = images.places.row(c) - images.places.row(a);
  const Eigen::RowVector3d normal =
      images.normals.row(a) + images.normals.row(b) + images.normals.row(c);
  const Eigen::RowVector3d doubled_area = ab.cross(ac);
  return std::copysign(0.5 * doubled_area.norm(), doubled_area.dot(normal));
}

Areas StarAreas(const TriangleMesh& mesh_x, const TriangleMesh& mesh_y,
                const Images& images) {
  const double whole_x = SurfaceArea(mesh_x);
  const double whole_y = SurfaceArea(mesh_y);
  Areas areas = Areas::Zero(mesh_x.num_vertices(), 2);
  for (VertexIndex f = 0; f < mesh_x.num_faces(); ++f) {
    const VertexIndex a = mesh_x.faces(f, 0);
    const VertexIndex b = mesh_x.faces(f, 1);
    const VertexIndex c = mesh_x.faces(f, 2);
    if (!images.is_there[a] || !images.is_there[b] || !images.is_there[c]) {
      continue;
    }
    const Eigen::RowVector2d area(FaceArea(mesh_x, f) / whole_x,
                                  SignedArea(images, a, b, c) / whole_y);
    for (const VertexIndex v : {a, b, c}) areas.row(v) += area;
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

/// LogAreaStretch of the images that CleanImages is told.
template <typename IsThere, typename Of>
std::vector<float> Stretch(const CleanMesh& x, const CleanMesh& y,
                           const IsThere& is_there, const Of& of) {
  const VertexStars stars(x.mesh);
  Areas areas = StarAreas(x.mesh, y.mesh, CleanImages(x, y, is_there, of));
  const int rounds = Rounds(x.mesh, y.mesh);
  for (int round = 0; round < rounds; ++round) areas = Averaged(areas, stars);
  std::vector<float> stretch(x.clean_from_original.size(),
                             std::numeric_limits<float>::quiet_NaN());
  for (std::size_t v = 0; v < stretch.size(); ++v) {
    const VertexIndex clean = x.clean_from_original[v];
    if (clean == kNoVertex || !is_there(static_cast<VertexIndex>(v))) continue;
    stretch[v] = LogRatio(areas.row(clean));
  }
  return stretch;
}

}  // namespace

std::vector<float> LogAreaStretch(const TriangleMesh& mesh_x,
                                  const TriangleMesh& mesh_y,
                                  absl::Span<const VertexIndex> y_from_x) {
  assert(static_cast<VertexIndex>(y_from_x.size()) == mesh_x.num_vertices());
  const CleanMesh y = Clean(mesh_y);
  const auto image = [&](VertexIndex v) {
    return y_from_x[v] == kNoVertex ? kNoVertex
                                    : y.clean_from_original[y_from_x[v]];
  };
  return Stretch(
      Clean(mesh_x), y, [&](VertexIndex v) { return image(v) != kNoVertex; },
      [&](const Positions& values, VertexIndex v) {
        return values.row(image(v)).eval();
      });
}

std::vector<float> LogAreaStretch(const TriangleMesh& mesh_x,
                                  const TriangleMesh& mesh_y,
                                  absl::Span<const SurfacePoint> images) {
  assert(static_cast<VertexIndex>(images.size()) == mesh_x.num_vertices());
  const CleanMesh y = Clean(mesh_y);
  const auto corner = [&](VertexIndex v, int i) {
    return y.clean_from_original[mesh_y.faces(images[v].face, i)];
  };
  return Stretch(
      Clean(mesh_x), y,
      [&](VertexIndex v) { return images[v].face != kNoVertex; },
      [&](const Positions& values, VertexIndex v) {
        Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
        for (int i = 0; i < 3; ++i) {
          sum += images[v].weights[i] * values.row(corner(v, i));
        }
        return sum;
      });
}

}  // namespace isomatch
