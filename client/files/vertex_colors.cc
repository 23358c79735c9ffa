#include "client/files/vertex_colors.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "core/mesh/mesh_geometry.h"

namespace isomatch {
namespace {

constexpr double kByteScale = 255;

}  // namespace

Colors PositionColors(const TriangleMesh& mesh) {
  const std::vector<Rgb> bytes = PositionRgb(mesh.positions, BoxOfFaces(mesh));
  Colors colors(mesh.num_vertices(), 3);
  for (std::size_t v = 0; v < bytes.size(); ++v) {
    for (std::size_t channel = 0; channel < 3; ++channel) {
      colors(static_cast<Eigen::Index>(v), static_cast<Eigen::Index>(channel)) =
          bytes[v][channel] / kByteScale;
    }
  }
  return colors;
}

Rgb ColorBytes(const Eigen::RowVector3d& color) {
  Rgb bytes;
  for (std::size_t channel = 0; channel < 3; ++channel) {
    const double value = color[static_cast<Eigen::Index>(channel)];
    bytes[channel] = static_cast<std::uint8_t>(
        std::lround(kByteScale * std::clamp(value, 0.0, 1.0)));
  }
  return bytes;
}

std::vector<PlyColumn> ColorColumns(const Colors& colors) {
  std::vector<PlyColumn> columns;
  for (const auto& [name, channel] :
       {std::pair("red", 0u), std::pair("green", 1u), std::pair("blue", 2u)}) {
    columns.push_back({name, PlyColumn::Type::kUchar,
                       [&colors, channel = channel](VertexIndex v) {
                         return ColorBytes(colors.row(v))[channel];
                       }});
  }
  return columns;
}

}  // namespace isomatch
