#pragma once

#include <string>

#include "absl/status/statusor.h"

namespace isomatch {

/// "jobs/" and the id; empty for a job without an id (validate_only).
std::string JobName(const std::string& id);

/// Returns the id: letters, digits, '-' and '_' only, so that it is the same id
/// wherever it goes. INVALID_ARGUMENT when `name` is not "jobs/" and an id.
absl::StatusOr<std::string> ParseJobName(const std::string& name);

}  // namespace isomatch
