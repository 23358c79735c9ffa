#pragma once

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/progress.h"

namespace isomatch {

/// Whether a map of whole shapes lies on Y as only few right ones do: torn, and
/// facing elsewhere.
bool IsTorn(const MapScores& scores);

/// Matches with `options`; while the map is torn, up to twice more with the
/// next random seeds, and returns the one that ranks best. Of some pairs the
/// right map is among the candidates with some seeds only. A mirrored map is
/// not looked for again, as X was changed for it.
///
/// What a hurry leaves undone is as if it had not begun. Errors of the first
/// match, and CANCELLED.
absl::StatusOr<Correspondence> MatchUntilNotTorn(
    const MatchOptions& options, const StopTokens& stops,
    absl::FunctionRef<absl::StatusOr<Correspondence>(
        const MatchOptions& options, const StopTokens& stops)>
        match);

}  // namespace isomatch
