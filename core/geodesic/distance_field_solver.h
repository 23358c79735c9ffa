#pragma once

#include <cstdint>
#include <stop_token>
#include <utility>
#include <vector>

#include "absl/types/span.h"
#include "core/base/vertex_index.h"
#include "core/geodesic/wavefront_stencils.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// Distance between vertices of different components. Finite, so that
/// differences stay numbers.
inline constexpr float kUnreachable = 1e30f;

/// Geodesic distance fields on one mesh by wavefront propagation (fast
/// marching) with the point-source update: the two known distances of an edge
/// give a virtual source in the plane, and the new distance is the straight
/// line from it where that crosses the edge, else the way along an edge. Exact
/// in the plane; the error on smooth surfaces falls with the edge length
/// (0.13 % at 10,000 vertices on the sphere). Vertices wait in buckets by
/// distance and are corrected when a better way turns up, so the order within
/// a bucket does not matter.
///
/// Not symmetric to the last digit: d(u, v) and d(v, u) differ by the error.
/// Thread-safe: each thread brings its own Workspace.
class DistanceFieldSolver {
 public:
  /// After `stop` all solving ends early, with fields that are not done: ask
  /// CheckNotCancelled before they are used.
  /// REQUIRES: a clean mesh (core/mesh/clean_mesh.h). Time and memory O(n).
  explicit DistanceFieldSolver(const TriangleMesh& mesh,
                               std::stop_token stop = {});

  /// A distance, and the vertex that has it.
  using Entry = std::pair<double, VertexIndex>;

  /// Scratch memory of one thread, about 80 bytes a vertex. May serve any
  /// solver.
  class Workspace {
   private:
    friend class DistanceFieldSolver;
    std::vector<double> distances;
    std::vector<VertexIndex> touched;
    std::vector<std::vector<Entry>> buckets;
    std::int64_t entries = 0;  ///< pushed since the source
  };

  VertexIndex num_vertices() const { return stencils_.num_vertices(); }
  const WavefrontStencils& stencils() const { return stencils_; }

  /// Writes the distance from `source` to every vertex, mesh units,
  /// kUnreachable to other components, to field[0], field[stride], ...
  /// REQUIRES: field has room for n entries at that stride. Time O(n).
  void Solve(VertexIndex source, float* field, std::int64_t stride,
             Workspace* workspace) const;

  /// Lowers nearest[v] to the distance from `source` where that is smaller;
  /// visits only the vertices it improves and their neighbors.
  /// REQUIRES: nearest.size() == n.
  void Lower(VertexIndex source, absl::Span<float> nearest,
             Workspace* workspace) const;

  /// Writes the distances from `source` to `targets`; stops once the front has
  /// passed them all. REQUIRES: equal sizes.
  void SolveTo(VertexIndex source, absl::Span<const VertexIndex> targets,
               absl::Span<float> distances, Workspace* workspace) const;

 private:
  /// What a visitor wants of the vertex it was shown.
  enum class Visit { kContinue, kPrune };

  template <typename Visitor, typename Finished>
  void Propagate(VertexIndex source, const Visitor& visit,
                 const Finished& finished, Workspace* workspace) const;
  void Relax(VertexIndex support, double distance, std::int64_t bucket,
             Workspace* workspace) const;
  void Push(VertexIndex vertex, double distance, std::int64_t bucket,
            Workspace* workspace) const;
  void Reset(Workspace* workspace) const;
  /// A bucket has more entries than there can be without corrections: round a
  /// vertex of very many faces each correction of it corrects them all.
  bool IsCrowded(const std::vector<Entry>& entries) const;
  /// Leaves those after the first `done` that hold still, at most one a vertex,
  /// in order.
  static void Thin(std::size_t done, std::vector<Entry>* entries,
                   Workspace* workspace);

  WavefrontStencils stencils_;
  std::stop_token stop_;
  double bucket_width_ = 1;
  double tolerance_ = 0;
};

}  // namespace isomatch
