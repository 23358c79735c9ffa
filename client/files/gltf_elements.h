#pragma once

#include <cstddef>
#include <optional>

#include "absl/strings/string_view.h"
#include "client/files/gltf_library.h"
#include "client/files/polygon_soup.h"

namespace isomatch {

/// The elements of an accessor, which lie in its buffer.
struct GltfElements {
  const unsigned char* first = nullptr;
  std::size_t count = 0;
  std::size_t stride = 0;
  int kind = 0;
  bool is_normalized = false;

  /// A number of an element, normalized where the file says so.
  double At(std::size_t element, std::size_t component) const;
};

/// What an accessor is asked for: the numbers of an element, least and most.
struct GltfWanted {
  const char* name;
  int least_components;
  int most_components;
};

/// Finds the elements of accessor `number`. Returns why it is not as wanted:
/// not there, with another number of components, sparse, or beyond its buffer.
std::optional<MeshFault> FindElements(const isomatch_tinygltf::Model& model,
                                      int number, const GltfWanted& wanted,
                                      GltfElements* elements);

/// Finds the bytes of bufferView `number`, or returns why they are not there.
std::optional<MeshFault> FindView(const isomatch_tinygltf::Model& model,
                                  int number, absl::string_view* bytes);

}  // namespace isomatch
