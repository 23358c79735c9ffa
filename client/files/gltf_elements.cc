#include "client/files/gltf_elements.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <type_traits>

#include "absl/strings/str_cat.h"

namespace isomatch {

using isomatch_tinygltf::Accessor;
using isomatch_tinygltf::Model;

namespace {

template <typename T>
double As(const unsigned char* at, bool is_normalized) {
  T number;
  std::memcpy(&number, at, sizeof(number));
  const auto value = static_cast<double>(number);
  if (!is_normalized || std::is_floating_point_v<T>) return value;
  return std::max(value / std::numeric_limits<T>::max(), -1.0);
}
}  // namespace

double GltfElements::At(std::size_t element, std::size_t component) const {
  const auto size =
      static_cast<std::size_t>(isomatch_tinygltf::GetComponentSizeInBytes(
          static_cast<std::uint32_t>(kind)));
  const unsigned char* const at = first + element * stride + component * size;
  switch (kind) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return As<std::int8_t>(at, is_normalized);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return As<std::uint8_t>(at, is_normalized);
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return As<std::int16_t>(at, is_normalized);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return As<std::uint16_t>(at, is_normalized);
    case TINYGLTF_COMPONENT_TYPE_INT:
      return As<std::int32_t>(at, is_normalized);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return As<std::uint32_t>(at, is_normalized);
    case TINYGLTF_COMPONENT_TYPE_FLOAT:
      return As<float>(at, is_normalized);
    default:
      return As<double>(at, is_normalized);
  }
}
// Checks that an accessor is as wanted and lies in its buffer.
std::optional<MeshFault> FindElements(const Model& model, int number,
                                      const GltfWanted& wanted,
                                      GltfElements* elements) {
  const auto refuse = [&](const std::string& what) {
    return MeshFault{
        "", absl::StrCat(wanted.name, ", accessor ", number, ": ", what)};
  };
  if (number < 0 || number >= static_cast<int>(model.accessors.size())) {
    return refuse(absl::StrCat("it is missing, expected one of ",
                               model.accessors.size(), " accessors"));
  }
  const Accessor& accessor = model.accessors[static_cast<std::size_t>(number)];
  const int components = isomatch_tinygltf::GetNumComponentsInType(
      static_cast<std::uint32_t>(accessor.type));
  if (components < wanted.least_components ||
      components > wanted.most_components) {
    return refuse(absl::StrCat("its elements have ", components,
                               " numbers, expected ", wanted.least_components,
                               " to ", wanted.most_components));
  }
  if (accessor.sparse.isSparse || accessor.bufferView < 0) {
    return refuse(
        "it is sparse or has no bufferView, expected all its "
        "elements in one");
  }
  absl::string_view bytes;
  if (auto fault = FindView(model, accessor.bufferView, &bytes)) {
    return refuse(fault->what);
  }
  const auto& view =
      model.bufferViews[static_cast<std::size_t>(accessor.bufferView)];
  const int component_bytes = isomatch_tinygltf::GetComponentSizeInBytes(
      static_cast<std::uint32_t>(accessor.componentType));
  if (component_bytes <= 0) {
    return refuse(absl::StrCat("its componentType is ", accessor.componentType,
                               ", expected one of glTF, as 5126"));
  }
  const std::size_t element = static_cast<std::size_t>(components) *
                              static_cast<std::size_t>(component_bytes);
  const std::size_t stride = view.byteStride == 0 ? element : view.byteStride;
  if (accessor.count == 0 || stride < element ||
      accessor.byteOffset > bytes.size() ||
      bytes.size() - accessor.byteOffset < element ||
      (bytes.size() - accessor.byteOffset - element) / stride <
          accessor.count - 1) {
    return refuse(
        absl::StrCat(accessor.count, " elements of ", element, " bytes, ",
                     stride, " apart, from byte ", accessor.byteOffset,
                     ", expected 1 or more that lie in the ", bytes.size(),
                     " bytes of bufferView ", accessor.bufferView));
  }
  *elements = {reinterpret_cast<const unsigned char*>(bytes.data()) +
                   accessor.byteOffset,
               accessor.count, stride, accessor.componentType,
               accessor.normalized};
  return std::nullopt;
}

std::optional<MeshFault> FindView(const Model& model, int number,
                                  absl::string_view* bytes) {
  if (number < 0 || number >= static_cast<int>(model.bufferViews.size())) {
    return MeshFault{"",
                     absl::StrCat("bufferView is ", number, ", expected 0 to ",
                                  model.bufferViews.size(), " - 1")};
  }
  const auto& view = model.bufferViews[static_cast<std::size_t>(number)];
  if (view.buffer < 0 ||
      view.buffer >= static_cast<int>(model.buffers.size())) {
    return MeshFault{
        "", absl::StrCat("bufferView ", number, " names buffer ", view.buffer,
                         ", expected 0 to ", model.buffers.size(), " - 1")};
  }
  const auto& data = model.buffers[static_cast<std::size_t>(view.buffer)].data;
  if (view.byteOffset > data.size() ||
      view.byteLength > data.size() - view.byteOffset) {
    return MeshFault{
        "", absl::StrCat("bufferView ", number, " has ", view.byteLength,
                         " bytes from ", view.byteOffset,
                         ", expected them in buffer ", view.buffer, " of ",
                         data.size(), " bytes")};
  }
  *bytes =
      absl::string_view(reinterpret_cast<const char*>(data.data()), data.size())
          .substr(view.byteOffset, view.byteLength);
  return std::nullopt;
}

}  // namespace isomatch
