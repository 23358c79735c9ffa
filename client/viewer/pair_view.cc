#include "client/viewer/pair_view.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include <Eigen/Geometry>

#include "absl/strings/str_cat.h"
#include "core/mesh/embedding.h"
#include "core/mesh/mesh_geometry.h"
#include "core/mesh/vertex_stars.h"

namespace isomatch {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

Eigen::RowVector3d Extents(const TriangleMesh& mesh) {
  return BoxOfFaces(mesh).sizes().transpose() / std::sqrt(SurfaceArea(mesh));
}

/// The flatter of two axes.
int Flatter(const Eigen::RowVector3d& extents, int first, int second) {
  return extents[first] <= extents[second] ? first : second;
}

/// The color at a place between the vertices of a face.
Rgb Mixed(const PairView& view, const SurfacePoint& point) {
  Rgb mixed;
  for (std::size_t channel = 0; channel < mixed.size(); ++channel) {
    double sum = 0;
    for (int i = 0; i < 3; ++i) {
      const VertexIndex y = view.y.mesh.faces(point.face, i);
      sum += point.weights[i] * view.colors_y[y][channel];
    }
    mixed[channel] = static_cast<std::uint8_t>(std::lround(sum));
  }
  return mixed;
}

/// The mean over the vertices that go to each vertex of Y.
std::vector<float> MeanOverImages(absl::Span<const float> on_x,
                                  absl::Span<const VertexIndex> y_from_x,
                                  VertexIndex vertices_y) {
  std::vector<double> sums(vertices_y);
  std::vector<int> counts(vertices_y);
  for (std::size_t x = 0; x < on_x.size(); ++x) {
    if (y_from_x[x] == kNoVertex || std::isnan(on_x[x])) continue;
    sums[y_from_x[x]] += on_x[x];
    ++counts[y_from_x[x]];
  }
  std::vector<float> means(vertices_y, kNone);
  for (VertexIndex y = 0; y < vertices_y; ++y) {
    if (counts[y] > 0) means[y] = static_cast<float>(sums[y] / counts[y]);
  }
  return means;
}

/// Vertices on faces of which `is_one` is true.
template <typename IsOne>
int CountSeen(const TriangleMesh& mesh, const IsOne& is_one) {
  const std::vector<bool> is_on_face = VerticesOnFaces(mesh);
  int count = 0;
  for (std::size_t v = 0; v < is_on_face.size(); ++v) {
    if (is_on_face[v] && is_one(v)) ++count;
  }
  return count;
}

}  // namespace

Positions NormalizedPositions(const TriangleMesh& mesh) {
  const Eigen::AlignedBox3d box = BoxOfFaces(mesh);
  const double scale = 1 / std::sqrt(SurfaceArea(mesh));
  Positions positions = mesh.positions;
  for (Eigen::Index v = 0; v < positions.rows(); ++v) {
    const Eigen::Vector3d inside =
        positions.row(v).transpose().cwiseMax(box.min()).cwiseMin(box.max());
    positions.row(v) = scale * (inside - box.center()).transpose();
  }
  return positions;
}

Eigen::Matrix3d ViewRotation(const TriangleMesh& mesh_x,
                             const TriangleMesh& mesh_y,
                             std::optional<int> up) {
  const Eigen::RowVector3d extents = Extents(mesh_x) + Extents(mesh_y);
  const bool flattest_along_y =
      extents[1] < extents[0] && extents[1] < extents[2];
  const int up_axis = up.value_or(flattest_along_y ? 2 : 1);
  const int depth = Flatter(extents, (up_axis + 1) % 3, (up_axis + 2) % 3);
  const Eigen::Vector3d upward = Eigen::Vector3d::Unit(up_axis);
  // A file with z up is seen from -y, as modelling programs do.
  const Eigen::Vector3d to_viewer =
      (up_axis == 2 && depth == 1 ? -1 : 1) * Eigen::Vector3d::Unit(depth);
  Eigen::Matrix3d rotation;
  rotation.row(0) = upward.cross(to_viewer).transpose();
  rotation.row(1) = upward.transpose();
  rotation.row(2) = to_viewer.transpose();
  return rotation;
}

std::vector<float> CarryToY(absl::Span<const float> on_x,
                            absl::Span<const VertexIndex> y_from_x,
                            const TriangleMesh& mesh_y,
                            absl::Span<const std::uint8_t> matched_y) {
  std::vector<float> on_y =
      MeanOverImages(on_x, y_from_x, mesh_y.num_vertices());
  VertexMap reached;
  for (VertexIndex y = 0; y < mesh_y.num_vertices(); ++y) {
    if (!std::isnan(on_y[y])) reached.push_back(y);
  }
  const VertexMap nearest =
      NearestByEdges(VertexStars(mesh_y), mesh_y.num_vertices(), reached);
  for (VertexIndex y = 0; y < mesh_y.num_vertices(); ++y) {
    if (nearest[y] != kNoVertex) on_y[y] = on_y[reached[nearest[y]]];
  }
  for (std::size_t y = 0; y < matched_y.size(); ++y) {
    if (matched_y[y] == 0) on_y[y] = kNone;
  }
  return on_y;
}

std::vector<Rgb> ColorsOfX(const PairView& view) {
  if (view.colors_x) return *view.colors_x;
  std::vector<Rgb> colors;
  colors.reserve(view.y_from_x.size());
  for (std::size_t x = 0; x < view.y_from_x.size(); ++x) {
    const VertexIndex y = view.y_from_x[x];
    if (y == kNoVertex) {
      colors.push_back(kGray);
    } else if (view.precise.empty()) {
      colors.push_back(view.colors_y[y]);
    } else {
      colors.push_back(Mixed(view, view.precise[x]));
    }
  }
  return colors;
}

std::vector<Rgb> ColorsOfY(const PairView& view) {
  std::vector<Rgb> colors = view.colors_y;
  if (view.colors_x) return colors;
  for (std::size_t y = 0; y < view.matched_y.size(); ++y) {
    if (view.matched_y[y] == 0) colors[y] = kGray;
  }
  return colors;
}

std::string GrayText(const PairView& view) {
  const int on_x = CountSeen(view.x.mesh, [&](std::size_t x) {
    return view.y_from_x[x] == kNoVertex;
  });
  const int on_y = CountSeen(view.y.mesh, [&](std::size_t y) {
    return !view.matched_y.empty() && view.matched_y[y] == 0;
  });
  if (on_x == 0 && on_y == 0) return "";
  return absl::StrCat("no counterpart: ", on_x, " vertices of X, ", on_y,
                      " of Y");
}

std::vector<Rgb> LayerColors(const ScalarLayer& layer,
                             absl::Span<const float> values) {
  std::vector<Rgb> colors;
  colors.reserve(values.size());
  for (const float value : values) {
    const double unit = (value - layer.low) / (layer.high - layer.low);
    colors.push_back(
        std::isnan(value)
            ? kGray
            : layer.palette[std::lround(255 * std::clamp(unit, 0.0, 1.0))]);
  }
  return colors;
}

const ScalarLayer* FindLayer(const PairView& view, const std::string& id) {
  const auto found =
      std::find_if(view.layers.begin(), view.layers.end(),
                   [&](const ScalarLayer& layer) { return layer.id == id; });
  return found == view.layers.end() ? nullptr : &*found;
}

}  // namespace isomatch
