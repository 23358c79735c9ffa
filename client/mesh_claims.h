#pragma once

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace isomatch {

/// Compares the counts in the header of an OFF file with the `bytes` of the
/// file, before any reader allocates for them. INVALID_ARGUMENT when the file
/// cannot hold what it claims, or is not one; the message has no path.
/// (FindPlyFault does so for PLY.)
absl::Status CheckOffClaims(absl::string_view bytes);

}  // namespace isomatch
