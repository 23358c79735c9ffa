#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// Returns the mesh that WriteDracoFile wrote, its vertices in their order.
/// NOT_FOUND: no such file. INVALID_ARGUMENT: as DecodeDraco. Messages name the
/// path.
absl::StatusOr<TriangleMesh> ReadDracoFile(const std::string& path);

/// Writes a mesh as clients send it: in single precision, not quantized.
/// UNAVAILABLE: it cannot be written. Else as EncodeDraco.
absl::Status WriteDracoFile(const std::string& path, const TriangleMesh& mesh);

}  // namespace isomatch
