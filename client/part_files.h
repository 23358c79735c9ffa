#pragma once

#include <string>

#include "absl/types/span.h"
#include "client/result_parts.h"
#include "core/mesh/triangle_mesh.h"
#include "core/pipeline/matcher.h"

namespace isomatch {

// Texts of the files that --precise, --confidence and --functional-map write;
// client/README.md tells what they look like. Numbers read back the same.

/// Lines `FACE W0 W1 W2`: the 0-based face of `mesh_y`, and the weights of its
/// vertices in its order (client/face_finder.h); `-1 0 0 0` for no place.
std::string FormatPreciseMap(absl::Span<const PrecisePoint> points,
                             const TriangleMesh& mesh_y);

/// One number a line.
std::string FormatConfidence(absl::Span<const float> confidence);

/// JSON: `eigenvalues_x`, `eigenvalues_y`, `matrix` as an array of rows.
std::string FormatFunctionalMap(const FunctionalMap& map);

}  // namespace isomatch
