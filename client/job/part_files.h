#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "core/io/result_bytes.h"
#include "core/mesh/precise_point.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

// The files that --precise, --confidence, --mask-y and --functional-map write,
// as text; client/README.md tells what they look like. Numbers read back the
// same.

/// Lines `FACE W0 W1 W2`: the 0-based face of `mesh_y`, and the weights of its
/// vertices in its order (client/files/face_finder.h); `-1 0 0 0` for no place.
std::string FormatPreciseMap(absl::Span<const PrecisePoint> points,
                             const TriangleMesh& mesh_y);

/// One number a line.
std::string FormatConfidence(absl::Span<const float> confidence);

/// Returns the numbers of a --confidence file; empty lines and what follows a #
/// are left out. INVALID_ARGUMENT, naming file and line, for anything but one
/// number from 0 to 1 a line, `vertices_x` of them; NOT_FOUND.
absl::StatusOr<std::vector<float>> ReadConfidence(const std::string& path,
                                                  std::int64_t vertices_x);

/// 1 or 0 a line.
std::string FormatMask(absl::Span<const char> matched_y);
/// Returns the numbers of a --mask-y file: 1 for a vertex of Y that has a
/// counterpart, 0 for one that has none. Lines and errors as ReadConfidence.
absl::StatusOr<std::vector<std::uint8_t>> ReadMaskY(const std::string& path,
                                                    std::int64_t vertices_y);

/// JSON: `eigenvalues_x`, `eigenvalues_y`, `matrix` as an array of rows.
std::string FormatFunctionalMap(const FunctionalMap& map);

}  // namespace isomatch
