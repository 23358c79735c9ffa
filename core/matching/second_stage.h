#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "core/base/control.h"
#include "core/base/random_stream.h"
#include "core/base/vertex_index.h"
#include "core/geodesic/basis_points.h"
#include "core/matching/closeness.h"

namespace isomatch {

/// A partial injective map between all vertices, both ways round.
struct PartialVertexMap {
  VertexMap y_from_x;
  VertexMap x_from_y;

  PartialVertexMap(VertexIndex vertices_x, VertexIndex vertices_y)
      : y_from_x(vertices_x, kNoVertex), x_from_y(vertices_y, kNoVertex) {}
  void Set(VertexIndex x, VertexIndex y) {
    y_from_x[x] = y;
    x_from_y[y] = x;
  }
};

/// One shape as the second stage and the final phase see it. References must
/// outlive them.
struct HashedShape {
  const Closeness& closeness;
  const Environments& environments;  ///< over all vertices, in their order
};
struct HashedPair {
  HashedShape x;
  HashedShape y;
};

/// E(v): the vertices in the environments of v's `count` nearest basis points,
/// each once, in increasing order (paper, Section 3.3.2, step 1).
std::vector<VertexIndex> MergedEnvironment(const HashedShape& shape,
                                           VertexIndex v, int count);

struct SecondStageOptions {
  /// Matches to reach, as a fraction of the vertices of the smaller shape.
  double fraction = 0.7;
  /// The paper stops expanding candidates "if it contains too many elements"
  /// to keep its time bounds and leaves the number open: here with the
  /// environment that brings them to this many.
  int max_candidates = 256;
  /// Eq. 8 is summed over this many nearest matched vertices.
  int max_matched = 64;
};

/// Second-stage insertion (paper, Section 3.3.2): vertices of X in random
/// order, each matched to the vertex that minimizes Eq. 8 over the matched
/// vertices near it, among the unmatched vertices near their images; where
/// there is none, the environments grow by 3 basis points at a time.
///
/// Injective afterward if it was before. Reports fractions in (0, 1].
/// CANCELLED after control.stop.
/// Time O(n (max_candidates + sqrt(n)) max_matched |Z|).
absl::Status RunSecondStage(const HashedPair& shapes,
                            const SecondStageOptions& options,
                            RandomStream* random, const Control& control,
                            PartialVertexMap* map);

}  // namespace isomatch
