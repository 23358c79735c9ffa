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

struct LoadedPair {
  LoadedMesh x;
  LoadedMesh y;
};

/// The same of X and Y, at the same time where there can be a thread; the
/// warnings, which name field and file, go to `warnings`, those of X first.
absl::StatusOr<LoadedPair> LoadMeshes(const std::string& path_x,
                                      const std::string& path_y,
                                      const std::string& weld,
                                      std::vector<std::string>* warnings);

}  // namespace isomatch
