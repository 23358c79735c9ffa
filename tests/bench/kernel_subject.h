#pragma once

#include <vector>

#include "core/geodesic/basis_points.h"
#include "core/matching/closeness.h"
#include "core/matching/matching.h"
#include "core/mesh/triangle_mesh.h"
#include "core/spectral/spectral_basis.h"

namespace isomatch::bench {

/// The sample animal with all that kernels need, of as many vertices as the
/// default profile solves on, in the order that the method works in.
struct KernelSubject {
  TriangleMesh mesh;
  std::vector<VertexIndex> farthest;
  BasisPoints basis;
  PointPool pool;
  SpectralBasis spectral;
};

/// Made once, by the first call. Aborts when it cannot be made.
const KernelSubject& TheKernelSubject();

/// `count` points of the pool matched with themselves.
Matching SelfMatching(const KernelSubject& subject, int count);

}  // namespace isomatch::bench
