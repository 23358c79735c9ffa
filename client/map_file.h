#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "core/base/vertex_index.h"

namespace isomatch {

/// Returns a map as the text of a MAP file: line i holds the 0-based vertex of
/// Y that vertex i of X corresponds to, or -1 for none.
std::string FormatMap(absl::Span<const VertexIndex> y_from_x);

/// Returns the map of a MAP file. INVALID_ARGUMENT, naming file and line, for
/// anything but one number a line from -1 to `vertices_y` - 1; NOT_FOUND.
absl::StatusOr<VertexMap> ReadMap(const std::string& path,
                                  std::int64_t vertices_y);

/// Returns the pairs of a landmark file: lines `x y`, 0-based; # starts a
/// comment. INVALID_ARGUMENT, naming file and line, for anything else, an index
/// out of range, or a vertex that is given two partners; NOT_FOUND.
absl::StatusOr<std::vector<VertexMatch>> ReadLandmarks(const std::string& path,
                                                       std::int64_t vertices_x,
                                                       std::int64_t vertices_y);

/// The truth about a pair. `mirrored` is empty, or as long as `direct`: where
/// the truth lies after a left-right reflection.
struct GroundTruth {
  VertexMap direct;
  VertexMap mirrored;
};

/// Returns the truth for `vertices_x` vertices of X. Either every line is `x y`
/// or `x y y_mirrored`, in any order (vertices of X without a line have no
/// truth), or every line is a bare y, -1 for none, line i for vertex i.
///
/// INVALID_ARGUMENT, naming file and line, for anything else; NOT_FOUND.
absl::StatusOr<GroundTruth> ReadGroundTruth(const std::string& path,
                                            std::int64_t vertices_x,
                                            std::int64_t vertices_y);

}  // namespace isomatch
