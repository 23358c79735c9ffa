#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "absl/status/statusor.h"

namespace isomatch::bench {

/// What `speed --out` wrote. INVALID_ARGUMENT where `path` is no such file.
absl::StatusOr<nlohmann::json> ReadSpeedReport(const std::string& path);

/// The mean over pairs of what each took (wall, processor, prepared) and of
/// each stage, as a pair of the report has them. REQUIRES: at least one pair.
nlohmann::json MeanOfPairs(const nlohmann::json& pairs);

/// A line for each pair that both reports have, and for their mean and its
/// stages: seconds now, before, and now as a part of before. Says where the
/// runs are not alike (profile, threads, instruction set) or have no pair in
/// common.
std::string ComparisonText(const nlohmann::json& now,
                           const nlohmann::json& before);

}  // namespace isomatch::bench
