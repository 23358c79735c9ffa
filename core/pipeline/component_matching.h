#pragma once

#include <cstddef>
#include <functional>
#include <stop_token>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "core/mesh/clean_mesh.h"
#include "core/mesh/topology.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/progress.h"

namespace isomatch {

/// A mesh and its large components, each at least a twentieth of the largest
/// one's area, biggest first.
struct SplitMesh {
  CleanMesh clean;
  Components components;
  std::vector<int> large;     ///< component numbers
  std::vector<double> areas;  ///< of the large ones, squared mesh units
};
/// CANCELLED after `stop`.
absl::StatusOr<SplitMesh> SplitIntoComponents(const TriangleMesh& mesh,
                                              const std::stop_token& stop);

/// Which large component of X (a position in SplitMesh::large) goes to which of
/// Y.
struct ComponentPair {
  int x;
  int y;
};

/// Pairs large components, each at most once, by what costs least: their
/// fractions of the area, how long they are for their area, and, where those do
/// not decide, where they lie in space. Landmarks between two components go
/// before all that. CANCELLED after `stop`. Time O(n).
absl::StatusOr<std::vector<ComponentPair>> PairComponents(
    const SplitMesh& split_x, const SplitMesh& split_y,
    absl::Span<const Landmark> landmarks, const std::stop_token& stop);

/// Match of one component to one.
using MatchOne = std::function<absl::StatusOr<Correspondence>(
    const TriangleMesh& mesh_x, const TriangleMesh& mesh_y,
    absl::Span<const Landmark> landmarks, const ProgressCallback& progress)>;

/// Whether meshes of so many large components at most are matched one by one:
/// of two to eight.
inline bool MatchedByComponents(std::size_t most) {
  return most > 1 && most <= 8;
}

/// What is matched by components. References must outlive it.
struct SplitPair {
  const TriangleMesh& mesh_x;
  const SplitMesh& x;
  const SplitMesh& y;
};

/// Matches each pair of components on its own and puts the results together:
/// maps and confidences side by side, figures as means by area, the least
/// symmetry confidence of a component, and as alternative the whole with the
/// runner-up of that one. What belongs to no pair goes where the vertex nearest
/// to it in space goes. There is no functional map of several components.
absl::StatusOr<Correspondence> MatchByComponents(
    const SplitPair& pair, absl::Span<const Landmark> landmarks,
    const MatchOne& match_one, const MatchControl& control);

}  // namespace isomatch
