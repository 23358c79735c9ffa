#include "tests/bench/kernels.h"

#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/base/nearest_columns.h"
#include "core/base/parallel.h"
#include "core/geodesic/basis_points.h"
#include "core/geodesic/farthest_point_sampling.h"
#include "core/geodesic/wavefront_stencils.h"
#include "core/matching/matching.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/progress.h"
#include "core/spectral/cotan_laplacian.h"
#include "core/spectral/filtered_subspace.h"
#include "core/spectral/functional_map.h"
#include "core/spectral/spectral_basis.h"
#include "tests/bench/kernel_subject.h"
#include "tests/bench/machine.h"

namespace isomatch::bench {
namespace {

/// The cost of an arithmetic kernel that does so much work in `seconds`.
KernelCost Arithmetic(std::string name, std::vector<Stage> stages,
                      std::string unit, double seconds, double units,
                      double flops) {
  return {.name = std::move(name),
          .stages = std::move(stages),
          .unit = std::move(unit),
          .ns_per_unit = 1e9 * seconds / units,
          .rate = 1e-9 * flops / seconds,
          .is_arithmetic = true};
}

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
  return {.name = "distance fields",
          .stages = {Stage::kGeodesics},
          .unit = "vertex and source",
          .ns_per_unit = 1e9 * seconds / units,
          .rate = 1e-9 * bytes / seconds,
          .is_arithmetic = false};
}

/// Competing maps grow side by side, one a task.
constexpr int kGrowingMaps = 64;

KernelCost InsertionCandidates(const KernelSubject& subject, int matches) {
  const Matching matching = SelfMatching(subject, matches);
  std::vector<std::vector<float>> errors(kGrowingMaps);
  const double seconds = BestSeconds([&] {
    ParallelFor(kGrowingMaps, {}, [&](std::int64_t map) {
      for (int point = matches; point < subject.pool.size(); ++point) {
        matching.EmbeddingErrors(kX, point, &errors[map]);
      }
    }).IgnoreError();
  });
  const double units = double(kGrowingMaps) * (subject.pool.size() - matches) *
                       subject.pool.size();
  // Of each match: a difference, its absolute value and a sum.
  const double flops = 3.0 * matches * units;
  return Arithmetic("candidates, " + std::to_string(matches) + " matches",
                    {Stage::kFirstInsertion}, "candidate", seconds, units,
                    flops);
}

KernelCost SwapProposals(const KernelSubject& subject, int matches) {
  const Matching matching = SelfMatching(subject, matches);
  constexpr int kRounds = 20;
  std::vector<double> changes(kGrowingMaps);  // so that none is left out
  const double seconds = BestSeconds([&] {
    ParallelFor(kGrowingMaps, {}, [&](std::int64_t map) {
      for (int round = 0; round < kRounds; ++round) {
        for (int i = 0; i < matches; ++i) {
          changes[map] += matching.SwapChange(i, (i + 1 + round) % matches);
        }
      }
    }).IgnoreError();
  });
  const double units = double(kGrowingMaps) * kRounds * matches;
  // Of each match: four differences, their absolute values, four sums.
  const double flops = 12.0 * matches * units;
  return Arithmetic("swap proposals, " + std::to_string(matches) + " matches",
                    {Stage::kFirstInsertion}, "proposal", seconds, units,
                    flops);
}

/// Among the vertices of a mesh in spectral space, as if all pairs were
/// compared, from queries that are off by a fifth.
KernelCost Nearest(const SpectralBasis& basis, int rows) {
  const PointColumns points = FunctionColumns(basis, rows);
  const float fifth =
      0.2f * points.norm() / std::sqrt(static_cast<float>(points.size()));
  constexpr float kUniformDeviation = 0.577f;  // of numbers in [-1, 1]
  const PointColumns queries =
      points + fifth / kUniformDeviation *
                   PointColumns::Random(points.rows(), points.cols());
  const double seconds = BestSeconds(
      [&] { NearestColumns(queries, points, {}).status().IgnoreError(); });
  const double pairs = std::pow(double(points.cols()), 2);
  return Arithmetic(
      "nearest neighbors, " + std::to_string(rows) + " dimensions",
      {Stage::kZoomOut, Stage::kChoice, Stage::kAlignment}, "candidate",
      seconds, pairs, 2 * double(rows) * pairs);
}

KernelCost Eigenpairs(const TriangleMesh& mesh, int count) {
  const CotanLaplacian laplacian = BuildCotanLaplacian(mesh);
  const double seconds = BestSeconds([&] {
    ComputeSpectralBasis(laplacian, count, {}).status().IgnoreError();
  });
  // Three times products of a block with itself and its image, half of each,
  // and its Ritz vectors; sparse solves come on top.
  constexpr double kRitz = 3;
  const double n = mesh.num_vertices();
  const auto block = static_cast<double>(SubspaceSize(count));
  return Arithmetic("eigenpairs", {Stage::kSpectral}, "vertex and pair",
                    seconds, n * count, kRitz * 4 * n * block * block);
}

}  // namespace

std::vector<KernelCost> MeasureKernels() {
  const MatchOptions options;
  const KernelSubject& subject = TheKernelSubject();
  return {DistanceFields(subject.mesh),
          Eigenpairs(subject.mesh, options.alignment_basis),
          InsertionCandidates(subject, options.selection_rounds[0].matches),
          InsertionCandidates(subject, options.first_stage_matches),
          SwapProposals(subject, options.selection_rounds[0].matches),
          SwapProposals(subject, options.first_stage_matches),
          Nearest(subject.spectral, options.alignment_basis)};
}

}  // namespace isomatch::bench
