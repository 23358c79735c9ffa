#pragma once

#include <optional>
#include <string>

#include "absl/strings/string_view.h"
#include "client/files/gltf_library.h"
#include "client/files/polygon_soup.h"

namespace isomatch {

/// Reads what a glTF file describes, with the buffers that it names in `folder`
/// or below; "" for none. The bytes of pictures stay as they are. Nothing is
/// checked but what OpenGltf checks: numbers of accessors, nodes and the like
/// may be any. Returns why it cannot be loaded.
std::optional<MeshFault> LoadGltf(absl::string_view bytes,
                                  const std::string& folder,
                                  isomatch_tinygltf::Model* model);

/// Whether a file that exists lies below `folder`, links followed.
bool IsBelow(const std::string& path, const std::string& folder);

}  // namespace isomatch
