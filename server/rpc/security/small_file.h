#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace isomatch {

/// Returns the bytes of a file of the configuration. INVALID_ARGUMENT with
/// `field` (e.g. "--tls-key"), the path and what was expected when it is
/// missing, not readable, not a regular file, empty, or above 1 MiB. The
/// message never has any of the content.
absl::StatusOr<std::string> ReadSmallFile(absl::string_view field,
                                          const std::string& path);

}  // namespace isomatch
