#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/command_line.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// Reads the mesh of a command's argument `field` and appends what is to be
/// said about it to `warnings`. Errors as ReadMesh.
absl::StatusOr<TriangleMesh> LoadMesh(const std::string& path,
                                      const std::string& field,
                                      std::vector<std::string>* warnings);

/// Prints `json` for machines, indented. File names in it need not be UTF-8.
/// Errors as Print.
absl::Status PrintJson(const nlohmann::ordered_json& json,
                       const Terminal& terminal);

/// INVALID_ARGUMENT when `output`, the value of `option`, is one of the files
/// that are read.
absl::Status CheckNotInput(const std::string& option, const std::string& output,
                           const std::vector<std::string>& inputs);

}  // namespace isomatch
