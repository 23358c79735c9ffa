#pragma once

#include <string>

#include "absl/strings/string_view.h"

namespace isomatch {

/// Returns a name that no other process of a cluster has or had: where this one
/// runs, its number, and the first of some random characters.
std::string ProcessName(absl::string_view random);

}  // namespace isomatch
