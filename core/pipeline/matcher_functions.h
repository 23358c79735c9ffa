#pragma once

#include "core/pipeline/correspondence.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/matcher.h"
#include "core/pipeline/prepared_shape.h"
#include "core/pipeline/progress.h"

/// The core is compiled once for each instruction set (core/CMakeLists.txt);
/// ISOMATCH_MATCHER_FUNCTIONS names what it is entered by.
#ifndef ISOMATCH_MATCHER_FUNCTIONS
#define ISOMATCH_MATCHER_FUNCTIONS isomatch_matcher_functions_baseline
#endif

namespace isomatch {

/// What of pipeline/matcher.h computes, compiled for one instruction set. The
/// functions of the same names call these.
struct MatcherFunctions {
  decltype(&Match) match;
  decltype(&Prepare) prepare;
  decltype(&PrepareBoth) prepare_both;
  decltype(&MatchPrepared) match_prepared;
  decltype(&ParsePreparedShape) parse_prepared_shape;
};

// Those compiled with this file.
absl::StatusOr<Correspondence> MatchHere(const TriangleMesh& mesh_x,
                                         const TriangleMesh& mesh_y,
                                         absl::Span<const Landmark> landmarks,
                                         const MatchOptions& options,
                                         const ProgressCallback& progress,
                                         std::stop_token stop);
absl::StatusOr<PreparedShape> PrepareHere(TriangleMesh mesh,
                                          const MatchOptions& options,
                                          const ProgressCallback& progress,
                                          std::stop_token stop);
absl::StatusOr<PreparedPair> PrepareBothHere(TriangleMesh mesh_x,
                                             TriangleMesh mesh_y,
                                             const MatchOptions& options,
                                             const ProgressCallback& progress,
                                             std::stop_token stop);
absl::StatusOr<Correspondence> MatchPreparedHere(
    const PreparedShape& x, const PreparedShape& y,
    absl::Span<const Landmark> landmarks, const MatchOptions& options,
    const ProgressCallback& progress, std::stop_token stop);
absl::StatusOr<PreparedShape> ParsePreparedShapeHere(absl::string_view bytes,
                                                     std::stop_token stop);

}  // namespace isomatch

extern "C" const isomatch::MatcherFunctions* ISOMATCH_MATCHER_FUNCTIONS();
