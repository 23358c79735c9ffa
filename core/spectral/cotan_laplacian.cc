#include "core/spectral/cotan_laplacian.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "core/mesh/mesh_geometry.h"

namespace isomatch {
namespace {

/// As a fraction of the mean edge length; see the header.
constexpr double kTriangleSlack = 1e-4;
/// As a fraction of the mean mass.
constexpr double kSmallestMass = 1e-6;

/// Length of the edge opposite each corner.
std::array<double, 3> EdgeLengths(const TriangleMesh& mesh, VertexIndex face) {
  std::array<double, 3> lengths;
  for (int corner = 0; corner < 3; ++corner) {
    lengths[corner] = (mesh.positions.row(mesh.faces(face, (corner + 1) % 3)) -
                       mesh.positions.row(mesh.faces(face, (corner + 2) % 3)))
                          .norm();
  }
  return lengths;
}

/// What every edge has to grow by for all triangles to keep the slack.
double MollificationLength(const TriangleMesh& mesh, double slack) {
  double needed = 0;
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    const auto [a, b, c] = EdgeLengths(mesh, f);
    const double longest = std::max({a, b, c});
    needed = std::max(needed, slack - (a + b + c - 2 * longest));
  }
  return needed;
}

/// Kahan's form of Heron's formula, stable for slivers.
double TriangleArea(std::array<double, 3> lengths) {
  std::sort(lengths.begin(), lengths.end());
  const auto [c, b, a] = lengths;
  const double product =
      (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c));
  return 0.25 * std::sqrt(std::max(0.0, product));
}

}  // namespace

CotanLaplacian BuildCotanLaplacian(const TriangleMesh& mesh) {
  const double growth =
      MollificationLength(mesh, kTriangleSlack * MeanEdgeLength(mesh));
  CotanLaplacian result;
  result.mass = Eigen::VectorXd::Zero(mesh.num_vertices());
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(12 * static_cast<std::size_t>(mesh.num_faces()));
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    std::array<double, 3> lengths = EdgeLengths(mesh, f);
    for (double& length : lengths) length += growth;
    const double area = TriangleArea(lengths);
    for (int corner = 0; corner < 3; ++corner) {
      const VertexIndex i = mesh.faces(f, (corner + 1) % 3);
      const VertexIndex j = mesh.faces(f, (corner + 2) % 3);
      const double opposite = lengths[corner];
      const double adjacent_1 = lengths[(corner + 1) % 3];
      const double adjacent_2 = lengths[(corner + 2) % 3];
      const double half_cotan =
          (adjacent_1 * adjacent_1 + adjacent_2 * adjacent_2 -
           opposite * opposite) /
          (8 * area);
      entries.emplace_back(i, j, -half_cotan);
      entries.emplace_back(j, i, -half_cotan);
      entries.emplace_back(i, i, half_cotan);
      entries.emplace_back(j, j, half_cotan);
      result.mass[mesh.faces(f, corner)] += area / 3;
    }
  }
  result.stiffness.resize(mesh.num_vertices(), mesh.num_vertices());
  result.stiffness.setFromTriplets(entries.begin(), entries.end());
  result.mass = result.mass.cwiseMax(kSmallestMass * result.mass.mean());
  return result;
}

Eigen::SparseMatrix<double> NormalizedStiffness(
    const CotanLaplacian& laplacian) {
  const Eigen::VectorXd scale = laplacian.mass.cwiseSqrt().cwiseInverse();
  return scale.asDiagonal() * laplacian.stiffness * scale.asDiagonal();
}

}  // namespace isomatch
