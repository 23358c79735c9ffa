#pragma once

#include <functional>

#include <nlohmann/json.hpp>

#include "absl/status/statusor.h"

namespace isomatch::bench {

/// What `work` returns, done in a process of its own, so that neither memory
/// that others left nor threads of theirs are there. For callers without
/// threads. What is printed there appears.
///
/// The status of `work`; INTERNAL when the process ended without one.
absl::StatusOr<nlohmann::json> InOwnProcess(
    const std::function<absl::StatusOr<nlohmann::json>()>& work);

}  // namespace isomatch::bench
