// The inner loops of the method alone, on as many vertices as the default
// profile solves on. Threads are one for each core where a kernel has them.
#include <cmath>
#include <numeric>
#include <vector>

#include <benchmark/benchmark.h>

#include "core/base/nearest_columns.h"
#include "core/geodesic/basis_points.h"
#include "core/geodesic/farthest_point_sampling.h"
#include "core/matching/closeness.h"
#include "core/pipeline/match_options.h"
#include "core/spectral/cotan_laplacian.h"
#include "core/spectral/functional_map.h"
#include "core/spectral/spectral_basis.h"
#include "tests/bench/kernel_subject.h"

namespace isomatch::bench {
namespace {

const MatchOptions kOptions;

// Items are what a kernel's cost grows with; the figure to look at is items a
// second.

void DistanceField(benchmark::State& state) {
  const KernelSubject& subject = TheKernelSubject();
  const DistanceFieldSolver solver(subject.mesh);
  DistanceFieldSolver::Workspace workspace;
  std::vector<float> field(solver.num_vertices());
  VertexIndex source = 0;
  for (auto unused : state) {
    solver.Solve(source, field.data(), 1, &workspace);
    source = (source + 97) % solver.num_vertices();
  }
  state.SetItemsProcessed(state.iterations() * solver.num_vertices());
}
BENCHMARK(DistanceField);

void FarthestPointSampling(benchmark::State& state) {
  const DistanceFieldSolver solver(TheKernelSubject().mesh);
  const auto count = static_cast<int>(state.range(0));
  for (auto unused : state) {
    benchmark::DoNotOptimize(FarthestPoints(solver, count, {}));
  }
  state.SetItemsProcessed(state.iterations() * count);
}
BENCHMARK(FarthestPointSampling)->Arg(64)->Arg(1000)->UseRealTime();

void ClosenessRow(benchmark::State& state) {
  const KernelSubject& subject = TheKernelSubject();
  const Closeness closeness(subject.basis, kOptions.kernel_width);
  std::vector<float> row(subject.farthest.size());
  for (auto unused : state) {
    closeness.Row(subject.farthest[7], subject.farthest, row.data());
    benchmark::DoNotOptimize(row.data());
  }
  state.SetItemsProcessed(state.iterations() *
                          static_cast<std::int64_t>(row.size()));
}
BENCHMARK(ClosenessRow);

void EmbeddingErrorsOfAllPoints(benchmark::State& state) {
  const KernelSubject& subject = TheKernelSubject();
  const auto matches = static_cast<int>(state.range(0));
  const Matching matching = SelfMatching(subject, matches);
  std::vector<float> errors;
  for (auto unused : state) {
    matching.EmbeddingErrors(kX, subject.pool.size() - 1, &errors);
    benchmark::DoNotOptimize(errors.data());
  }
  state.SetItemsProcessed(state.iterations() * matches * subject.pool.size());
}
BENCHMARK(EmbeddingErrorsOfAllPoints)->Arg(12)->Arg(120);

void SwapChange(benchmark::State& state) {
  const auto matches = static_cast<int>(state.range(0));
  const Matching matching = SelfMatching(TheKernelSubject(), matches);
  int i = 0;
  for (auto unused : state) {
    benchmark::DoNotOptimize(matching.SwapChange(i, matches - 1));
    i = (i + 1) % (matches - 1);
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(SwapChange)->Arg(12)->Arg(120);

void NearestOfAllVertices(benchmark::State& state) {
  const KernelSubject& subject = TheKernelSubject();
  const PointColumns points =
      FunctionColumns(subject.spectral, kOptions.alignment_basis);
  // Off by about a fifth, as maps are before they are refined.
  const float fifth =
      0.2f * points.norm() / std::sqrt(static_cast<float>(points.size()));
  const PointColumns queries =
      points + fifth * PointColumns::Random(points.rows(), points.cols());
  for (auto unused : state) {
    benchmark::DoNotOptimize(NearestColumns(queries, points, {}));
  }
  state.SetItemsProcessed(state.iterations() * points.cols() * points.cols());
}
BENCHMARK(NearestOfAllVertices)->UseRealTime();

void FunctionalMapOfADenseMap(benchmark::State& state) {
  const KernelSubject& subject = TheKernelSubject();
  const PointColumns functions =
      FunctionColumns(subject.spectral, kOptions.alignment_basis);
  VertexMap identity(subject.mesh.num_vertices());
  std::iota(identity.begin(), identity.end(), 0);
  for (auto unused : state) {
    benchmark::DoNotOptimize(DenseFunctionalMap(
        functions, subject.spectral.mass, functions, identity));
  }
  state.SetItemsProcessed(state.iterations() * functions.cols());
}
BENCHMARK(FunctionalMapOfADenseMap)->UseRealTime();

void Eigenpairs(benchmark::State& state) {
  const CotanLaplacian laplacian = BuildCotanLaplacian(TheKernelSubject().mesh);
  const auto count = static_cast<int>(state.range(0));
  for (auto unused : state) {
    benchmark::DoNotOptimize(ComputeSpectralBasis(laplacian, count, {}));
  }
  state.SetItemsProcessed(state.iterations() * count);
}
BENCHMARK(Eigenpairs)->Arg(60)->Arg(128)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace isomatch::bench

BENCHMARK_MAIN();
