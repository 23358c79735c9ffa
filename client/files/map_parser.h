#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "client/files/input_file.h"
#include "client/files/map_file.h"

namespace isomatch {

/// The format of a MAP file that was read from `path`: as its extension says,
/// of standard input as its first bytes do.
MapFormat MapFormatOf(const std::string& path, const InputFile& file);

/// ReadMap of a file that was read from `path`.
absl::StatusOr<VertexMap> ParseMap(const std::string& path,
                                   const InputFile& file,
                                   std::int64_t vertices_y,
                                   std::optional<std::int64_t> vertices_x);

}  // namespace isomatch
