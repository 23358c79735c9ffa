#include "core/mesh/decimation.h"

#include <cstddef>
#include <vector>

#include <meshoptimizer.h>

namespace isomatch {
namespace {

/// Of the mesh's extent: no limit, the count of vertices alone is one.
constexpr float kAnyError = 1e6f;

/// Vertices per face of a closed surface.
constexpr double kFacesPerVertex = 2;

}  // namespace

CoarseMesh Decimate(const TriangleMesh& mesh, VertexIndex target) {
  // meshoptimizer works in single precision: as near to the origin as can be.
  const Eigen::RowVector3d center = mesh.positions.colwise().mean();
  const Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor> positions =
      (mesh.positions.rowwise() - center).cast<float>();
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
