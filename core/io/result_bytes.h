#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/base/vertex_index.h"
#include "core/mesh/precise_point.h"

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

// The parts of a result as a server sends them and clients get them. All
// numbers are little-endian, n is the number of vertices of X, m that of Y:
//
//   map             n uint32, 0xFFFFFFFF for no match
//   precise map     n times three uint32 (vertices of a face of Y) and three
//                   float32 (barycentric coordinates)
//   confidence      n float32
//   functional map  uint32 k, then float64: k eigenvalues of X, k of Y, the
//                   k x k matrix by rows
//   mask            m bytes: 1 for a vertex with a counterpart on X, else 0
//
// float32 is enough: no point is known as well as to 1e-7 of an edge.

std::string EncodeMap(const VertexMap& y_from_x);
std::string EncodePreciseMap(const std::vector<PrecisePoint>& points);
std::string EncodeConfidence(const std::vector<float>& confidence);
std::string EncodeFunctionalMap(const FunctionalMap& map);
/// REQUIRES: each is 0 or 1.
std::string EncodeMask(const std::vector<char>& matched_y);

// These return DATA_LOSS for another number of bytes than expected, for a
// vertex that Y does not have, and for anything but 0 and 1 in a mask.

absl::StatusOr<VertexMap> DecodeMap(absl::string_view bytes, PairSize size);
absl::StatusOr<std::vector<PrecisePoint>> DecodePreciseMap(
    absl::string_view bytes, PairSize size);
absl::StatusOr<std::vector<float>> DecodeConfidence(absl::string_view bytes,
                                                    PairSize size);
absl::StatusOr<FunctionalMap> DecodeFunctionalMap(absl::string_view bytes);
absl::StatusOr<std::vector<char>> DecodeMask(absl::string_view bytes,
                                             PairSize size);

}  // namespace isomatch
