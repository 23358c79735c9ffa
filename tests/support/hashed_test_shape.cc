#include "tests/support/hashed_test_shape.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/geodesic/farthest_point_sampling.h"
#include "core/mesh/mesh_geometry.h"

namespace isomatch {
namespace {

constexpr double kWidth = 0.3;

std::vector<VertexIndex> Farthest(const DistanceFieldSolver& solver,
                                  int pool_size) {
  const int basis = BasisPoints::DefaultCount(solver.num_vertices());
  return *FarthestPoints(solver, std::max(pool_size, basis), {});
}

BasisPoints MakeBasis(const DistanceFieldSolver& solver,
                      const std::vector<VertexIndex>& farthest) {
  const int count = BasisPoints::DefaultCount(solver.num_vertices());
  return *BasisPoints::Create(
      solver, {farthest.begin(), farthest.begin() + count}, {}, {});
}

std::vector<VertexIndex> AllVertices(const TriangleMesh& mesh) {
  std::vector<VertexIndex> all(mesh.num_vertices());
  std::iota(all.begin(), all.end(), 0);
  return all;
}

/// Farthest points first, then the other vertices.
std::vector<VertexIndex> WithOthers(std::vector<VertexIndex> farthest,
                                    const TriangleMesh& mesh) {
  for (const VertexIndex v : AllVertices(mesh)) {
    if (std::find(farthest.begin(), farthest.end(), v) == farthest.end()) {
      farthest.push_back(v);
    }
  }
  return farthest;
}

}  // namespace

HashedTestShape::HashedTestShape(TriangleMesh mesh, int pool_size)
    : mesh_(std::move(mesh)),
      solver_(mesh_),
      farthest_(Farthest(solver_, pool_size)),
      basis_(MakeBasis(solver_, farthest_)),
      closeness_(basis_, kWidth * std::sqrt(SurfaceArea(mesh_))),
      pool_(*PointPool::Create(
          closeness_, pool_size > 0 ? farthest_ : WithOthers(farthest_, mesh_),
          {})),
      frames_(GatherFrames(mesh_.positions, VertexNormals(mesh_),
                           Eigen::VectorXd::Zero(mesh_.num_vertices()), pool_)),
      environments_(EnvironmentsOf(basis_, AllVertices(mesh_))) {
  pool_.ListNearest({}).IgnoreError();  // without a stop there is no error
}

}  // namespace isomatch
