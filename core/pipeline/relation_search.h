#pragma once

#include <functional>

#include "absl/status/statusor.h"
#include "core/mesh/triangle_mesh.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/progress.h"

namespace isomatch {

/// What is known of a shape before it is matched.
struct ShapeOutline {
  /// Length of all edges with one face alone, sqrt(area); a closed surface has
  /// none, and what was cut off a body has about 1 or more.
  double rim = 0;
  double area = 0;  ///< squared mesh units
};

/// REQUIRES: the mesh has an area.
ShapeOutline OutlineOf(const TriangleMesh& mesh);

/// Matches two shapes once as what `options` says, which is never
/// Relation::kAuto, and judges the map. The progress is that of a whole match.
using MatchAs = std::function<absl::StatusOr<Correspondence>(
    const MatchOptions& options, const MatchControl& control)>;

/// How many maps FindRelation makes at most.
int MostTries(const ShapeOutline& x, const ShapeOutline& y,
              const MatchOptions& options);

/// Finds out which relation two shapes have, by their rims, their areas, where
/// LengthScale::kSame makes those tell something, and how confident the maps
/// are that they have as one and the other: the most confident one is returned,
/// with its relation_confidence. A shape without a rim is whole; of two without
/// no more is asked. What options.relation tells is not tried otherwise.
///
/// Which seed grows to an overlap is chance: where the map is not confident,
/// and could still win, two more random seeds are tried, and the map with the
/// lowest rank value is kept of those that are not bad. The same way a part of
/// unknown scale is tried at the next likely one, then with another seed, and
/// one in the same unit, where no other relation is likely, with two more; the
/// most confident map is kept. In a hurry nothing more is tried once there is a
/// map; its relation_confidence is 0 then, unless no other came in question.
///
/// Not in the paper. Errors are those of `match`, of the most likely relation
/// where all fail.
absl::StatusOr<Correspondence> FindRelation(const ShapeOutline& x,
                                            const ShapeOutline& y,
                                            const MatchOptions& options,
                                            const MatchControl& control,
                                            const MatchAs& match);

}  // namespace isomatch
