#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/strings/string_view.h"

namespace isomatch {

/// Returns the bytes that the line "`key`: N kB" of a file of /proc, such as
/// /proc/meminfo, says; nullopt when there is no such line.
std::optional<std::int64_t> ReadProcBytes(const std::string& path,
                                          absl::string_view key);

}  // namespace isomatch
