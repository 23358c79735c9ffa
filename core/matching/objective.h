#pragma once

#include "core/matching/matching.h"

namespace isomatch {

/// Eq. 4 of a partial map: mean of k_X(x_i, x_j) k_Y(y_i, y_j) over the ordered
/// pairs i != j. In [0, 1]; the paper sums. 0 for fewer than two matches.
double Objective(const Matching& matching);

/// Eq. 8 of a partial map: mean of |k_X(x_i, x_j) - k_Y(y_i, y_j)| over the
/// ordered pairs i != j. In [0, 1], 0 for an isometry.
double EmbeddingError(const Matching& matching);

}  // namespace isomatch
