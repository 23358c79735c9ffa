#pragma once

#include <cstdint>
#include <stop_token>
#include <vector>

#include <Eigen/Core>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "core/base/vertex_index.h"
#include "core/geodesic/basis_points.h"

namespace isomatch {

/// Eq. 5: k(u, v) = exp(-d(u, v) / width), in [0, 1], with the lower bound of
/// Eq. 6 for d. With widths well below the diameter only near distances
/// matter, and for those the lower bound is nearly exact (paper, Appendix A).
///
/// Thread-safe. Keeps a reference to `basis`.
class Closeness {
 public:
  /// `width` in mesh units, > 0.
  Closeness(const BasisPoints& basis, double width)
      : basis_(&basis), inverse_width_(static_cast<float>(1 / width)) {}

  /// k(u, v); 0 across components.
  float operator()(VertexIndex u, VertexIndex v) const;

  /// Writes k(u, v) for each v of `vertices`. Time O(vertices |Z|).
  void Row(VertexIndex u, absl::Span<const VertexIndex> vertices,
           float* row) const;

  const BasisPoints& basis() const { return *basis_; }
  float inverse_width() const { return inverse_width_; }

 private:
  const BasisPoints* basis_;
  float inverse_width_;
};

/// Rows of closeness to the same vertices, for many: the same bits as
/// Closeness::Row in a third of the time. Memory: 4 |Z| vertices bytes.
/// Thread-safe. Keeps a reference to `closeness`.
class ClosenessRows {
 public:
  ClosenessRows(const Closeness& closeness,
                absl::Span<const VertexIndex> vertices);

  /// Writes k(u, v) for each of the vertices.
  void Row(VertexIndex u, float* row) const;

 private:
  const Closeness& closeness_;
  const Eigen::Index count_;
  Eigen::Index stride_;          ///< of whole blocks
  std::vector<float> profiles_;  ///< |Z| x stride: basis point by basis point
};

/// Position of the smallest value, the first of equal ones.
int LeastOf(absl::Span<const float> values);

/// Positions of the `count` largest of `size` values other than `self`, in
/// decreasing order, ties by position.
std::vector<int> ClosestOf(const float* closeness, int size, int self,
                           int count);

/// The vertices of one mesh that take part in seeds and first-stage insertion,
/// and the closeness between them. Points are positions in vertices().
///
/// Memory: 4 P^2 bytes when tabulated, and 256 P for lists of the nearest, else
/// O(P). Thread-safe once built.
class PointPool {
 public:
  /// Pools up to this size keep a table of all their closeness values.
  static constexpr int kMaxTabulated = 4096;
  /// Length of the list of nearest points.
  static constexpr int kNearest = 64;

  static absl::StatusOr<PointPool> Create(const Closeness& closeness,
                                          std::vector<VertexIndex> vertices,
                                          const std::stop_token& stop);

  /// Lists the nearest points of each, when tabulated. CANCELLED after `stop`.
  absl::Status ListNearest(const std::stop_token& stop);

  int size() const { return static_cast<int>(vertices_.size()); }
  VertexIndex vertex(int point) const { return vertices_[point]; }
  const std::vector<VertexIndex>& vertices() const { return vertices_; }
  const Closeness& closeness() const { return *closeness_; }

  /// Returns k(point, .) for all points of the pool: a row of the table, or
  /// computed into `storage`.
  const float* Row(int point, std::vector<float>* storage) const;

  /// The points closest to `point` but for itself, closest first, ties by
  /// index: up to kNearest of them, none before ListNearest.
  absl::Span<const int> Nearest(int point) const {
    const std::size_t count = nearest_.size() / vertices_.size();
    return absl::MakeConstSpan(nearest_).subspan(point * count, count);
  }

 private:
  const Closeness* closeness_ = nullptr;
  std::vector<VertexIndex> vertices_;
  std::vector<float> table_;  ///< P x P, or empty
  std::vector<int> nearest_;  ///< of each point
};

}  // namespace isomatch
