#include "core/mesh/decimation.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <numeric>
#include <utility>
#include <vector>

#include <meshoptimizer.h>

namespace isomatch {
namespace {

/// Of the mesh's extent: no limit, the count of vertices alone is one.
constexpr float kAnyError = 1e6f;

/// Of a closed surface.
constexpr double kFacesPerVertex = 2;

using FloatPositions = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// meshoptimizer takes vertices at one place for one and does not collapse what
/// is no seam there. These are different vertices: they get places of their
/// own, a hair apart.
void SetApart(float hair, FloatPositions* positions) {
  std::vector<VertexIndex> order(positions->rows());
  std::iota(order.begin(), order.end(), 0);
  const auto place = [&](VertexIndex v) {
    return std::array<float, 3>{(*positions)(v, 0), (*positions)(v, 1),
                                (*positions)(v, 2)};
  };
  std::sort(order.begin(), order.end(), [&](VertexIndex a, VertexIndex b) {
    return std::pair(place(a), a) < std::pair(place(b), b);
  });
  std::vector<VertexIndex> same;
  for (std::size_t i = 1; i < order.size(); ++i) {
    if (place(order[i]) == place(order[i - 1])) same.push_back(order[i]);
  }
  for (std::size_t i = 0; i < same.size(); ++i) {
    constexpr std::size_t kSteps = 64;
    (*positions)(same[i], static_cast<Eigen::Index>(i % 3)) +=
        hair * static_cast<float>(1 + i % kSteps);
  }
}

}  // namespace

CoarseMesh Decimate(const TriangleMesh& mesh, VertexIndex target) {
  // meshoptimizer works in single precision: as near to the origin as can be.
  const Eigen::RowVector3d center = mesh.positions.colwise().mean();
  FloatPositions positions = (mesh.positions.rowwise() - center).cast<float>();
  SetApart(1e-6f * positions.cwiseAbs().maxCoeff(), &positions);
  const std::vector<unsigned int> corners(
      mesh.faces.data(), mesh.faces.data() + mesh.faces.size());
  // A mesh with a boundary has fewer faces for its vertices.
  const double faces_per_vertex = std::min(
      kFacesPerVertex, double{1} * mesh.num_faces() / mesh.num_vertices());
  const auto wanted = static_cast<std::size_t>(faces_per_vertex * target);
  std::vector<unsigned int> left(corners.size());
  left.resize(meshopt_simplify(left.data(), corners.data(), corners.size(),
                               positions.data(), positions.rows(),
                               3 * sizeof(float), 3 * wanted, kAnyError));
  CoarseMesh coarse;
  VertexMap coarse_from_fine(mesh.num_vertices(), kNoVertex);
  for (const unsigned int v : left) coarse_from_fine[v] = 0;
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    if (coarse_from_fine[v] == kNoVertex) continue;
    coarse_from_fine[v] =
        static_cast<VertexIndex>(coarse.fine_from_coarse.size());
    coarse.fine_from_coarse.push_back(v);
  }
  coarse.mesh.positions = mesh.positions(coarse.fine_from_coarse, Eigen::all);
  coarse.mesh.faces.resize(static_cast<Eigen::Index>(left.size() / 3), 3);
  for (std::size_t i = 0; i < left.size(); ++i) {
    coarse.mesh.faces.data()[i] = coarse_from_fine[left[i]];
  }
  return coarse;
}

}  // namespace isomatch
