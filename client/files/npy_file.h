#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "absl/types/span.h"

namespace isomatch {

/// Returns the bytes of a NumPy file (.npy, version 1.0) that holds `values` as
/// an array of one dimension, int64.
std::string FormatNpy(absl::Span<const std::int64_t> values);

/// Returns the numbers of a NumPy file: an array of one dimension, little
/// endian int8, int16, int32, int64, uint8, uint16, uint32 or uint64.
///
/// INVALID_ARGUMENT, naming `path`, the byte, what was found and what was
/// expected, for anything else. Nothing is allocated for what the file only
/// claims.
absl::StatusOr<std::vector<std::int64_t>> ParseNpy(const std::string& path,
                                                   absl::string_view bytes);

}  // namespace isomatch
