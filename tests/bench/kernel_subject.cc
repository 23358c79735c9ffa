#include "tests/bench/kernel_subject.h"

#include "client/sample/sample_animal.h"
#include "core/geodesic/farthest_point_sampling.h"
#include "core/mesh/clean_mesh.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/prepared_mesh.h"
#include "core/spectral/cotan_laplacian.h"

namespace isomatch::bench {

const KernelSubject& TheKernelSubject() {
  static const KernelSubject& subject = *[] {
    const MatchOptions options;
    const auto sample = MakeSample({.vertices = options.solved_vertices});
    auto* made = new KernelSubject;
    made->mesh = MakeWorkingMesh(Clean(sample->mesh), {})->mesh;
    const DistanceFieldSolver solver(made->mesh);
    made->farthest = *FarthestPoints(solver, options.pool_size, {});
    const int count = BasisPoints::DefaultCount(made->mesh.num_vertices());
    made->basis = *BasisPoints::Create(
        solver, {made->farthest.begin(), made->farthest.begin() + count}, {},
        {});
    static const Closeness closeness(made->basis, options.kernel_width);
    made->pool = *PointPool::Create(closeness, made->farthest, {});
    made->pool.ListNearest({}).IgnoreError();
    made->spectral = *ComputeSpectralBasis(BuildCotanLaplacian(made->mesh),
                                           options.alignment_basis, {});
    return made;
  }();
  return subject;
}

Matching SelfMatching(const KernelSubject& subject, int count) {
  Matching matching(subject.pool, subject.pool, count);
  for (int p = 0; p < count; ++p) matching.Add({p, p});
  return matching;
}

}  // namespace isomatch::bench
