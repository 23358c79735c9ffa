#pragma once

#include "absl/types/span.h"

namespace isomatch {

/// A matched point of X, as it tells where on Y another one belongs: as far
/// from its image as the other one is from it.
struct Witness {
  int y;                     ///< its image
  const float* distances_y;  ///< from there to each point of Y
  float distance;            ///< from it to the other point, on X
  float inverse_tolerance;
  float weight;
};

/// A point of Y, -1 for none, and what it costs as a place.
struct PlaceFound {
  int y = -1;
  float cost = 0;
};

/// Returns the place that costs least, the first of several, or -1 and `most`
/// where none costs less than that: `place_weight` times what `place_costs` has
/// for the point, and for each witness, times its weight, the part of its
/// tolerance by which the distance is off, 1 at most. Not in the paper. Time
/// O(places witnesses).
PlaceFound CheapestPlace(absl::Span<const int> places, const float* place_costs,
                         float place_weight,
                         absl::Span<const Witness> witnesses, float most);

}  // namespace isomatch
