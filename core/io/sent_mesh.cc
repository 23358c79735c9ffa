// How a mesh is sent, as far as that is not Draco's: whoever matches meshes
// that were not sent does the same, so that their maps are the same.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

#include "core/io/draco_mesh.h"
#include "core/io/face_order.h"
#include "core/mesh/mesh_geometry.h"

namespace isomatch {
namespace {

using Face = std::array<VertexIndex, 3>;

// The face from the corner on that makes its vertices smallest as a sequence.
Face Turned(VertexIndex a, VertexIndex b, VertexIndex c) {
  return std::min({Face{a, b, c}, Face{b, c, a}, Face{c, a, b}});
}

}  // namespace

void SortFaces(VertexIndex end, Faces& faces) {
  std::vector<std::uint32_t> place(static_cast<std::size_t>(end) + 1, 0);
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    ++place[faces.row(f).minCoeff() + 1];
  }
  std::partial_sum(place.begin(), place.end(), place.begin());
  std::vector<Face> sorted(faces.rows());
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    const Face face = Turned(faces(f, 0), faces(f, 1), faces(f, 2));
    sorted[place[face[0]]++] = face;
  }
  // By their first vertex they are; few have the same one.
  for (auto begin = sorted.begin(); begin != sorted.end();) {
    const auto next = sorted.begin() + place[begin->front()];
    std::sort(begin, next);
    begin = next;
  }
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    faces.row(f) << sorted[f][0], sorted[f][1], sorted[f][2];
  }
}

Eigen::RowVector3d SentOriginOf(const TriangleMesh& mesh) {
  const Eigen::AlignedBox3d box = BoxOfFaces(mesh);
  const double extent = box.sizes().maxCoeff();
  if (!(extent > 0)) return Eigen::RowVector3d::Zero();
  const double step = std::ldexp(1.0, std::ilogb(extent) + 4);
  const Eigen::Array3d middle = 0.5 * (box.min() + box.max()) / step;
  return ((middle + 0.5).floor() * step).matrix().transpose();
}

}  // namespace isomatch
