#pragma once

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace isomatch {

/// Compares what an OFF or PLY file claims - the counts of its header, and the
/// lengths of a PLY file's lists - with the `bytes` of the file, before any
/// reader allocates for them. INVALID_ARGUMENT when the file cannot hold what
/// it claims, or is not one; the message has no path.
absl::Status CheckOffClaims(absl::string_view bytes);
absl::Status CheckPlyClaims(absl::string_view bytes);

}  // namespace isomatch
