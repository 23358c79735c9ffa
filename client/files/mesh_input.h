#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/files/mesh_file.h"

namespace isomatch {

/// Reads the mesh of a command's argument `field`, welds it as --weld `weld`
/// says ("" for not at all) and appends what is to be said about it to
/// `warnings`. Errors as ReadMesh, ParseWeldTolerance and WeldVertices.
absl::StatusOr<LoadedMesh> LoadMeshFile(const std::string& path,
                                        const std::string& field,
                                        const std::string& weld);

/// The same; the warnings, which name field and file, go to `warnings`.
absl::StatusOr<LoadedMesh> LoadMesh(const std::string& path,
                                    const std::string& field,
                                    const std::string& weld,
                                    std::vector<std::string>* warnings);

}  // namespace isomatch
