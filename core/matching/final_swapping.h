#pragma once

#include "absl/status/status.h"
#include "core/base/control.h"
#include "core/matching/second_stage.h"

namespace isomatch {

/// Eq. 9: what the match of x contributes to the objective of Eq. 4,
///   sum over matched x' in E_X(x), x' != x, of k_X(x, x') k_Y(y(x), y(x')).
/// (The paper writes UE, the unmatched vertices, which have no y; the matched
/// ones must be meant.)
/// REQUIRES: x is matched.
double Contribution(const HashedShape& shape_x, const HashedShape& shape_y,
                    const PartialVertexMap& map, VertexIndex x);

/// The final phase (paper, Section 3.4), simulated annealing at temperature 0:
/// the `fraction` of matches that contribute least are candidates, and each
/// exchanges its image with that candidate whose image lies in the environments
/// of its own and with which both together gain most, if any does. Both sums of
/// Eq. 9 run over the environments of both vertices here: over each one's own,
/// as the paper may mean it, every vertex near a tip gains by moving inwards,
/// and right maps are torn up.
///
/// The sum of the two contributions never falls in an exchange. Reports
/// fractions in (0, 1]. CANCELLED after control.stop.
absl::Status SwapWorst(const HashedPair& shapes, double fraction,
                       const Control& control, PartialVertexMap* map);

}  // namespace isomatch
