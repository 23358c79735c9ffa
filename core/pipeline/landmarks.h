#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "core/base/vertex_index.h"
#include "core/geodesic/basis_points.h"
#include "core/matching/seed_generator.h"
#include "core/pipeline/prepared_mesh.h"

namespace isomatch {

/// One landmark on solved vertices.
struct WorkingLandmark {
  VertexMatch match;
  std::size_t index;  ///< in the user's list
  /// It has a solved vertex in common with an earlier one, and so takes no part
  /// in finding the map.
  bool follows = false;
};

/// Landmarks as solved vertices, each full vertex once; at most 1000, evenly
/// from the list. `warnings` gets what was left out. INVALID_ARGUMENT: one is
/// on no face.
absl::StatusOr<std::vector<WorkingLandmark>> TakeLandmarks(
    absl::Span<const VertexMatch> landmarks, const PreparedMesh& x,
    const PreparedMesh& y, std::vector<std::string>* warnings);

/// The vertices on one side of those that take part in finding the map.
std::vector<VertexIndex> VerticesOf(
    const std::vector<WorkingLandmark>& landmarks, Side side);

/// Returns those landmarks that agree with each other: while some agree with
/// fewer than half of the rest, the worst goes. Two agree when their distance
/// on X and on Y differ by less than a tenth and a bit. Two or fewer are all
/// returned.
std::vector<VertexMatch> AgreeingLandmarks(
    const std::vector<WorkingLandmark>& landmarks, const BasisPoints& basis_x,
    const BasisPoints& basis_y);

/// Returns where competing maps start when `given` matches are known: at those
/// alone, at those together with each generated seed, and, unless `exact`, also
/// at the better half of the generated seeds alone, or the best 20 of them
/// beside four or more known matches.
std::vector<Seed> SeedsWithLandmarks(const Seed& given,
                                     const std::vector<Seed>& generated,
                                     bool exact);

}  // namespace isomatch
