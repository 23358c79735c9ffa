#include "tests/bench/kernels.h"

#include <cmath>
#include <string>

#include "client/sample_animal.h"
#include "core/base/nearest_columns.h"
#include "core/geodesic/basis_points.h"
#include "core/geodesic/farthest_point_sampling.h"
#include "core/geodesic/wavefront_stencils.h"
#include "core/mesh/clean_mesh.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/prepared_mesh.h"
#include "core/spectral/cotan_laplacian.h"
#include "core/spectral/functional_map.h"
#include "core/spectral/spectral_basis.h"
#include "tests/bench/machine.h"

namespace isomatch::bench {
namespace {

KernelCost DistanceFields(const TriangleMesh& mesh) {
  const DistanceFieldSolver solver(mesh);
  const int sources = BasisPoints::DefaultCount(mesh.num_vertices());
  const auto points = FarthestPoints(solver, sources, {});
  const double seconds = BestSeconds([&] {
    BasisPoints::Create(solver, *points, {}, {}).status().IgnoreError();
  });
  const double units = double(mesh.num_vertices()) * sources;
  // Each field reads every stencil once at least.
  const double bytes = double(WavefrontStencils(mesh).size()) *
                       sizeof(WavefrontStencil) * sources;
  return {"distance fields", "vertex and source", 1e9 * seconds / units,
          1e-9 * bytes / seconds, false};
}

/// Among the vertices of a mesh in spectral space, as if all pairs were
/// compared, from queries that are off by a fifth.
KernelCost Nearest(const TriangleMesh& mesh, int rows) {
  const auto basis = ComputeSpectralBasis(BuildCotanLaplacian(mesh), rows, {});
  if (!basis.ok()) return {};
  const PointColumns points = FunctionColumns(*basis, rows);
  const float fifth =
      0.2f * points.norm() / std::sqrt(static_cast<float>(points.size()));
  constexpr float kUniformDeviation = 0.577f;  // of numbers in [-1, 1]
  const PointColumns queries =
      points + fifth / kUniformDeviation *
                   PointColumns::Random(points.rows(), points.cols());
  const double seconds = BestSeconds(
      [&] { NearestColumns(queries, points, {}).status().IgnoreError(); });
  const double pairs = std::pow(double(mesh.num_vertices()), 2);
  return {"nearest neighbours, " + std::to_string(rows) + " dimensions",
          "pair of vertices", 1e9 * seconds / pairs,
          1e-9 * 2 * double(rows) * pairs / seconds, true};
}

KernelCost Eigenpairs(const TriangleMesh& mesh, int count) {
  const CotanLaplacian laplacian = BuildCotanLaplacian(mesh);
  const double seconds = BestSeconds([&] {
    ComputeSpectralBasis(laplacian, count, {}).status().IgnoreError();
  });
  // One sweep of Lanczos orthogonalises its vectors, each against all before
  // it, there and back.
  const double n = mesh.num_vertices();
  const double subspace = LanczosSubspace(count);
  return {"eigenpairs", "vertex and pair", 1e9 * seconds / (n * count),
          1e-9 * 2 * n * subspace * subspace / seconds, true};
}

}  // namespace

std::vector<KernelCost> MeasureKernels() {
  const MatchOptions options;
  const auto sample = MakeSample({.vertices = options.solved_vertices});
  if (!sample.ok()) return {};
  // In the order that the method works in.
  const auto working = MakeWorkingMesh(Clean(sample->mesh), {});
  if (!working.ok()) return {};
  return {DistanceFields(working->mesh),
          Nearest(working->mesh, options.alignment_basis),
          Eigenpairs(working->mesh, options.alignment_basis)};
}

}  // namespace isomatch::bench
