#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/pipeline/match_options.h"

namespace isomatch::bench {

/// Applies settings of the form name=number, names as in MatchOptions, and
/// checks the result. INVALID_ARGUMENT lists the names.
absl::Status ApplyOverrides(const std::vector<std::string>& settings,
                            MatchOptions* options);

}  // namespace isomatch::bench
