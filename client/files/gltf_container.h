#pragma once

#include <optional>
#include <string>

#include "absl/strings/string_view.h"
#include "client/files/polygon_soup.h"

namespace isomatch {

/// A glTF file before anything of it is believed.
struct GltfContainer {
  /// Whether it is binary, .glb.
  bool is_binary = false;
  absl::string_view json;
};

/// Finds the JSON of a glTF file, binary or text, and checks what would cost
/// more than the file has: that the chunks of a binary file lie in it, that the
/// JSON is of glTF 2, neither deep nor with more values than a scene has, that
/// one buffer at most is the file's own, and that no extension is required that
/// packs geometry.
///
/// Returns the first fault, by byte where there is one. Time O(size), memory 40
/// bytes for each byte of JSON and at most 100 MB.
std::optional<MeshFault> OpenGltf(absl::string_view bytes,
                                  GltfContainer* container);

}  // namespace isomatch
