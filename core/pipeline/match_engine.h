#pragma once

#include <functional>

#include "core/pipeline/matcher.h"
#include "core/pipeline/memory_estimate.h"
#include "core/pipeline/prepared_shape.h"

namespace isomatch {

/// What computes, as values: the functions that were compiled for one
/// instruction set, or whatever a test puts in their place. None is empty.
struct MatchEngine {
  std::function<decltype(Prepare)> prepare;
  std::function<decltype(PrepareBoth)> prepare_both;
  std::function<decltype(MatchPrepared)> match;
  std::function<decltype(ParsePreparedShape)> parse;
  std::function<decltype(EstimateMemoryBytes)> estimate;
};

/// Returns the functions of those names, on the instruction set of the moment.
MatchEngine CoreMatchEngine();

}  // namespace isomatch
