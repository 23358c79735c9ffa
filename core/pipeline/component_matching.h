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

/// A mesh in parts: the large components, each at least a twentieth of the
/// largest one's area, biggest first.
struct MeshParts {
  CleanMesh clean;
  Components components;
  std::vector<int> large;     ///< component numbers
  std::vector<double> areas;  ///< of the large ones, squared mesh units
};
/// CANCELLED after `stop`.
absl::StatusOr<MeshParts> SplitIntoParts(const TriangleMesh& mesh,
                                         const std::stop_token& stop);

/// Which large part of X (a position in MeshParts::large) goes to which of Y.
struct PartPair {
  int x;
  int y;
};

/// Pairs large parts, each at most once, by what costs least: their fractions
/// of the area, how long they are for their area, and, where those do not
/// decide, where they lie in space. Landmarks between two parts go before all
/// that. CANCELLED after `stop`. Time O(n).
absl::StatusOr<std::vector<PartPair>> PairParts(
    const MeshParts& parts_x, const MeshParts& parts_y,
    absl::Span<const Landmark> landmarks, const std::stop_token& stop);

/// Match of one part to one part.
using MatchOne = std::function<absl::StatusOr<Correspondence>(
    const TriangleMesh& mesh_x, const TriangleMesh& mesh_y,
    absl::Span<const Landmark> landmarks, const ProgressCallback& progress)>;

/// Whether meshes of so many large parts at most are matched part by part: of
/// two to eight.
inline bool MatchedByParts(std::size_t most) { return most > 1 && most <= 8; }

/// Matches each pair of parts on its own and puts the results together: maps
/// and confidences side by side, figures as means by area, the least symmetry
/// confidence of a part, and as alternative the whole with the runner-up of
/// that part. What belongs to no pair goes where the vertex nearest to it in
/// space goes. There is no functional map of several parts.
absl::StatusOr<Correspondence> MatchByParts(
    const TriangleMesh& mesh_x, const MeshParts& parts_x,
    const MeshParts& parts_y, absl::Span<const Landmark> landmarks,
    const MatchOne& match_one, const ProgressCallback& progress,
    const std::stop_token& stop);

}  // namespace isomatch
