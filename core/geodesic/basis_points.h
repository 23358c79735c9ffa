#pragma once

#include <cstdint>
#include <functional>
#include <stop_token>
#include <vector>

#include "Eigen/Core"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "core/base/sorted_buckets.h"
#include "core/base/vertex_index.h"
#include "core/geodesic/distance_field_solver.h"
#include "core/geodesic/field_sweeps.h"

namespace isomatch {

/// Locality sensitive hashing of geodesic distances (paper, Section 3.1): the
/// distances of every vertex to sqrt(n) basis points take the place of the n^2
/// distances between vertices.
///
/// Memory: 4 n |Z| bytes. Thread-safe once built.
class BasisPoints {
 public:
  /// Basis points a vertex's environments are made of.
  static constexpr int kEnvironmentsPerVertex = 3;

  /// sqrt(n), at least 16, at most n.
  static int DefaultCount(VertexIndex num_vertices);

  /// Computes the fields of `points`, in parallel. `progress`, when set, is
  /// called with a fraction in (0, 1], from one thread at a time.
  /// `least_change`: as of FieldSweeps, which compute the fields of small
  /// meshes.
  static absl::StatusOr<BasisPoints> Create(
      const DistanceFieldSolver& solver, std::vector<VertexIndex> points,
      const std::function<void(double)>& progress, const std::stop_token& stop,
      float least_change = FieldSweeps::kRounding);

  /// Makes them from fields that were computed before. REQUIRES:
  /// fields.size() == num_vertices * points.size(), one row for each vertex.
  static BasisPoints FromFields(std::vector<VertexIndex> points,
                                VertexIndex num_vertices,
                                std::vector<float> fields);
  const std::vector<float>& fields() const { return fields_; }

  /// The vertices Z, in order of farthest point sampling.
  const std::vector<VertexIndex>& points() const { return points_; }
  int num_points() const { return static_cast<int>(points_.size()); }
  VertexIndex num_vertices() const { return num_vertices_; }

  /// Distance between vertex v and basis point number z, mesh units.
  float Distance(VertexIndex v, int z) const { return Profile(v)[z]; }

  /// Distances of a vertex to all basis points.
  const float* Profile(VertexIndex v) const {
    return fields_.data() + std::int64_t{v} * num_points();
  }

  /// Eq. 6: max_z |d(z, u) - d(z, v)| <= d(u, v) <= min_z d(z, u) + d(z, v),
  /// up to the error of the fields.
  float LowerBound(VertexIndex u, VertexIndex v) const;
  float UpperBound(VertexIndex u, VertexIndex v) const;

  /// The `count` basis points (as numbers into points()) nearest to v, nearest
  /// first, ties by number. The paper stores this order for every vertex; here
  /// it is sorted when asked for, which saves 2 n |Z| bytes.
  std::vector<int> Nearest(VertexIndex v, int count) const;

  /// Mean distance of basis point z to all vertices it reaches.
  float MeanDistance(int z) const;

 private:
  std::vector<VertexIndex> points_;
  VertexIndex num_vertices_ = 0;
  std::vector<float> fields_;  ///< n x |Z|, row by vertex
};

/// Distances between `points`, P x P, symmetric, mesh units, kUnreachable
/// between components: means of the fields of both ends, which differ in their
/// last digits. `least_change` as in BasisPoints::Create. CANCELLED after
/// `stop`.
absl::StatusOr<Eigen::MatrixXf> DistancesAmong(
    const DistanceFieldSolver& solver, absl::Span<const VertexIndex> points,
    const std::stop_token& stop, float least_change = FieldSweeps::kRounding);

/// The environment of each basis point: the vertices among whose three nearest
/// basis points it is (paper, Section 3.1, Figure 2). Each vertex is in exactly
/// min(3, |Z|) environments.
/// Over `vertices` only; members are positions in that list, ascending.
using Environments = SortedBuckets<std::int32_t>;
Environments EnvironmentsOf(const BasisPoints& basis,
                            absl::Span<const VertexIndex> vertices);

}  // namespace isomatch
