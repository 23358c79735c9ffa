#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/base/vertex_index.h"
#include "core/pipeline/precise_point.h"

namespace isomatch {

/// Vertices of the two meshes that a result is about.
struct PairSize {
  VertexIndex vertices_x = 0;
  VertexIndex vertices_y = 0;
};

/// The first k eigenfunctions of Y carried to X.
struct FunctionalMap {
  /// k eigenvalues each, 1 / area.
  Eigen::VectorXd eigenvalues_x;
  Eigen::VectorXd eigenvalues_y;
  /// k x k; columns are eigenfunctions of Y, rows of X.
  Eigen::MatrixXd fmap_x_from_y;
};

// Each returns what the bytes of a downloaded part say; ResultPart in
// service.proto gives their layout. DATA_LOSS: another number of bytes than
// expected, or a vertex that Y does not have.

absl::StatusOr<VertexMap> DecodeMap(absl::string_view bytes, PairSize size);
absl::StatusOr<std::vector<PrecisePoint>> DecodePreciseMap(
    absl::string_view bytes, PairSize size);
absl::StatusOr<std::vector<float>> DecodeConfidence(absl::string_view bytes,
                                                    PairSize size);
absl::StatusOr<FunctionalMap> DecodeFunctionalMap(absl::string_view bytes);

}  // namespace isomatch
