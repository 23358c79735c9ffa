#pragma once

#include "core/base/random_stream.h"
#include "core/matching/matching.h"

namespace isomatch {

/// How swaps are proposed and how many.
struct SwapOptions {
  /// Proposals a phase.
  int proposals = 2500;
  /// Partners are drawn from this many nearest matches on X; any match when 0.
  int neighbors = 0;
};

/// One phase of simulated annealing (paper, Section 3.4): proposes
/// transpositions of the images of two matches and accepts each that lowers
/// the energy, and one that raises it by dE with probability exp(-dE /
/// temperature) (Eq. 3 with k = 1). At temperature 0 the energy never rises.
/// Proposals that touch a pinned match are refused. Returns how many were
/// accepted.
int SwapPhase(const SwapOptions& options, double temperature,
              RandomStream* random, Matching* matching);

/// One sweep over all matches that are not pinned: each moves its image to the
/// best of the `neighbors` nearest unmatched points of Y if that lowers the
/// energy. Returns the number of moves. Not in the paper: swaps alone cannot
/// move a match to where no match is.
int RelocationSweep(int neighbors, Matching* matching);

}  // namespace isomatch
