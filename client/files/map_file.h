#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "core/base/vertex_index.h"

namespace isomatch {

/// How a MAP file is written, known by its extension.
enum class MapFormat {
  /// Line i holds the 0-based vertex of Y that vertex i of X corresponds to, or
  /// -1 for none: every extension but the others.
  kText,
  /// .npy: the same numbers as a NumPy array of int64.
  kNpy,
  /// .json: {"format": "isomatch-map", "version": 1, "vertices_x": n,
  /// "vertices_y": m, "y_from_x": [the same numbers]}.
  kJson,
  /// .ply: X in the colors of Y (client/files/map_ply.h). Only to be written.
  kPly,
};
MapFormat MapFormatOf(const std::string& path);

/// Returns a map as the text of a MAP file.
std::string FormatMap(absl::Span<const VertexIndex> y_from_x);

/// Returns a map as the bytes of a MAP file. REQUIRES: not kPly.
std::string FormatMap(absl::Span<const VertexIndex> y_from_x,
                      std::int64_t vertices_y, MapFormat format);

/// Returns the map of a MAP file, whose extension tells the format. Its entries
/// are -1 to `vertices_y` - 1, as many as `vertices_x` when that is given.
/// INVALID_ARGUMENT, naming file, line or entry, what was found and what was
/// expected, for anything else; NOT_FOUND.
absl::StatusOr<VertexMap> ReadMap(const std::string& path,
                                  std::int64_t vertices_y,
                                  std::optional<std::int64_t> vertices_x = {});

/// Returns the labels of `vertices` vertices: one whole number a line, or a
/// .npy file. Errors as ReadMap.
absl::StatusOr<std::vector<std::int64_t>> ReadLabels(const std::string& path,
                                                     std::int64_t vertices);

/// Labels as the bytes of a file that is to be at `path`: .npy, else text.
std::string FormatLabels(const std::string& path,
                         absl::Span<const std::int64_t> labels);

/// Returns the pairs of a landmark file: lines `x y`, 0-based; # starts a
/// comment. INVALID_ARGUMENT, naming file and line, for anything else, an index
/// out of range, or a vertex that is given two partners; NOT_FOUND.
absl::StatusOr<std::vector<VertexMatch>> ReadLandmarks(const std::string& path,
                                                       std::int64_t vertices_x,
                                                       std::int64_t vertices_y);

/// The truth about a pair.
struct GroundTruth {
  /// kNoVertex for vertices of X that have no counterpart, or are not named.
  VertexMap direct;
  /// Where the truth lies after a left-right reflection; as long as `direct`,
  /// or empty.
  VertexMap mirrored;
  /// Which vertices of X the truth says something about; empty: all.
  std::vector<bool> named = {};
};

/// Returns the truth for `vertices_x` vertices of X. Either every line is `x y`
/// or `x y y_mirrored`, in any order (vertices of X without a line are not
/// named), or every line is a bare y, line i for vertex i. A .npy or .json file
/// is a map of all vertices of X. -1 stands for no counterpart.
///
/// INVALID_ARGUMENT, naming file and line, for anything else; NOT_FOUND.
absl::StatusOr<GroundTruth> ReadGroundTruth(const std::string& path,
                                            std::int64_t vertices_x,
                                            std::int64_t vertices_y);

}  // namespace isomatch
