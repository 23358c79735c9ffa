#pragma once

#include <cstddef>
#include <cstdint>
#include <stop_token>
#include <vector>

#include "absl/types/span.h"
#include "core/base/lanes.h"
#include "core/base/vertex_index.h"
#include "core/geodesic/distance_field_solver.h"
#include "core/geodesic/wavefront_stencils.h"

namespace isomatch {

/// Distance fields of many sources, eight at a time: the eight distances of a
/// vertex lie side by side, and one update computes them all. Sources that go
/// together lie near each other, so their fronts pass a vertex at about the
/// same time; vertices are visited by their number of edges from the first
/// source, again and again while a vertex next to them changes.
///
/// The update is that of DistanceFieldSolver, in single precision, so on
/// well-shaped faces the fields are the same but for rounding (1e-5 of the
/// largest distance). On slivers the distances here are shorter: the solver
/// tries an edge only when one of its ends has just changed, and can miss a way
/// that opens later (.07 % of the length in a sheared plane; here exact). The
/// same bytes at any thread count. Thread-safe: each thread brings its own
/// Workspace.
class FieldSweeps {
 public:
  /// With more vertices the tables outgrow the caches, and the fronts of a
  /// group disagree about the order: one source at a time is as fast at 10,000
  /// vertices and takes half the time at 100,000.
  static constexpr VertexIndex kMostVertices = 8192;

  /// A relative change that is nothing but rounding.
  static constexpr float kRounding = 1e-6f;

  /// Changes of no more than `least_change`, relative, go no farther: fields
  /// become some times as much too long, and at 1e-3 take two thirds of the
  /// time. Time and memory O(n), 250 bytes a vertex; keeps nothing of
  /// `stencils`.
  explicit FieldSweeps(const WavefrontStencils& stencils,
                       float least_change = kRounding);

  /// Scratch memory of one thread, 45 bytes a vertex.
  class Workspace {
   private:
    friend class FieldSweeps;
    std::vector<float> distances;     ///< n x kLanes
    std::vector<VertexIndex> order;   ///< by edges from the first source
    std::vector<std::int32_t> edges;  ///< from the first source, -1: none
    std::vector<char> waiting;        ///< whether a neighbor changed
  };

  VertexIndex num_vertices() const {
    return static_cast<VertexIndex>(first_.size()) - 1;
  }

  /// Returns the positions in `sources`, each once, in groups of 1 to kLanes
  /// whose sources lie near each other and in one component. Time O(n) a group.
  std::vector<std::vector<int>> Groups(
      absl::Span<const VertexIndex> sources) const;

  /// Leaves the fields of sources[z] for all z of `group`, one of Groups, in
  /// `workspace`. Ends early, with fields that are not done, after `stop`.
  void Solve(absl::Span<const VertexIndex> sources, absl::Span<const int> group,
             const std::stop_token& stop, Workspace* workspace) const;

  /// The distance that Solve left from the source number `lane` of its group to
  /// `vertex`, mesh units; kUnreachable to other components.
  float Distance(const Workspace& workspace, VertexIndex vertex,
                 std::size_t lane) const {
    const float distance =
        workspace.distances[std::size_t{kLanes} * vertex + lane];
    return distance < kFar ? distance * scale_ : kUnreachable;
  }

 private:
  /// A way to a vertex over the edge ab, in the plane of the (unfolded)
  /// triangle: a at (0, 0), b at (base, 0), the vertex at (x, y). Unit: scale_.
  struct Triangle {
    VertexIndex a, b;
    float base, inverse_base;
    float x, y;
    float from_a, from_b;  ///< lengths to the vertex
  };

  /// No distance yet, in mean edges. Its square is finite.
  static constexpr float kFar = 1e18f;

  void OrderFrom(VertexIndex source, Workspace* workspace) const;
  bool Update(VertexIndex vertex, bool over_planes, float* distances) const;
  void SetWaiting(VertexIndex changed, std::vector<char>* waiting) const;

  float scale_ = 1;                        ///< mean edge, mesh units
  float kept_ = 1;                         ///< part that is left by a change
  std::vector<std::int64_t> first_;        ///< n + 1, of each vertex's run
  std::vector<Triangle> triangles_;        ///< by the vertex they lead to
  std::vector<std::int64_t> first_after_;  ///< n + 1, as first_, of after_
  /// For each vertex, those whose distances may change when its own does: it is
  /// a or b of a triangle that leads to them.
  std::vector<VertexIndex> after_;
};

}  // namespace isomatch
