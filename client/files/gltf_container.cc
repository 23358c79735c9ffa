#include "client/files/gltf_container.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>

#include <nlohmann/json.hpp>

#include "absl/algorithm/container.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "client/files/json_limits.h"
#include "client/files/text_file.h"

namespace isomatch {
namespace {

using Json = nlohmann::json;

constexpr std::size_t kHeaderBytes = 12;
constexpr std::size_t kChunkHeaderBytes = 8;
constexpr std::uint32_t kJsonChunk = 0x4E4F534A;
constexpr std::uint32_t kBinaryChunk = 0x004E4942;

// A node of a scene has some 30 values, and takes the reader some 2 kB.
constexpr JsonLimits kLimits = {.depth = 64,
                                .values = std::int64_t{1} << 20,
                                .objects = std::int64_t{1} << 16};

std::uint32_t NumberAt(absl::string_view bytes, std::size_t at) {
  std::uint32_t number = 0;
  std::memcpy(&number, bytes.data() + at, sizeof(number));
  return number;
}

MeshFault FaultAt(std::size_t byte, std::string what) {
  return {absl::StrCat("byte ", byte), std::move(what)};
}

// Takes the chunk at `at`, which ends before `end`.
std::optional<MeshFault> TakeChunk(absl::string_view bytes, std::uint32_t kind,
                                   std::size_t* at, absl::string_view* chunk) {
  const char* const name = kind == kJsonChunk ? "JSON" : "BIN";
  if (bytes.size() - *at < kChunkHeaderBytes) {
    return FaultAt(*at, absl::StrCat("the file ends in the header of the ",
                                     name, " chunk, expected 8 bytes"));
  }
  const std::size_t size = NumberAt(bytes, *at);
  if (NumberAt(bytes, *at + 4) != kind) {
    return FaultAt(*at + 4, absl::StrCat("another chunk, expected ", name));
  }
  if (size > bytes.size() - *at - kChunkHeaderBytes || size % 4 != 0 ||
      size == 0) {
    return FaultAt(
        *at, absl::StrCat("the ", name, " chunk has ", size, " bytes, expected",
                          " a multiple of 4 from 4 to ",
                          bytes.size() - *at - kChunkHeaderBytes,
                          ", the file's rest"));
  }
  *chunk = bytes.substr(*at + kChunkHeaderBytes, size);
  *at += kChunkHeaderBytes + size;
  return std::nullopt;
}

std::optional<MeshFault> OpenBinary(absl::string_view bytes,
                                    absl::string_view* json) {
  if (bytes.size() < kHeaderBytes) {
    return FaultAt(bytes.size(), "the file ends in its header, expected more");
  }
  if (const std::uint32_t version = NumberAt(bytes, 4); version != 2) {
    return FaultAt(4, absl::StrCat("glTF version ", version, ", expected 2"));
  }
  const std::uint32_t length = NumberAt(bytes, 8);
  if (length > bytes.size() || length < kHeaderBytes) {
    return FaultAt(8, absl::StrCat("the header claims ", length,
                                   " bytes, but the file has ", bytes.size()));
  }
  bytes = bytes.substr(0, length);
  std::size_t at = kHeaderBytes;
  if (auto fault = TakeChunk(bytes, kJsonChunk, &at, json)) return fault;
  if (at == bytes.size()) return std::nullopt;
  absl::string_view binary;
  return TakeChunk(bytes, kBinaryChunk, &at, &binary);
}

std::optional<MeshFault> ParseJson(absl::string_view text, std::size_t offset,
                                   Json* json) {
  if (const auto fault = CheckJsonText(text, kLimits)) {
    const std::string what =
        absl::StrCat(fault->what, ", expected a scene of glTF");
    return fault->byte ? FaultAt(offset + *fault->byte, what)
                       : MeshFault{"", what};
  }
  *json = Json::parse(text, /*cb=*/nullptr, /*allow_exceptions=*/false);
  return std::nullopt;
}

std::optional<MeshFault> CheckExtensions(const Json& json) {
  constexpr std::array<absl::string_view, 3> kPacked = {
      "KHR_draco_mesh_compression", "EXT_meshopt_compression",
      "KHR_meshopt_compression"};
  const auto required = json.find("extensionsRequired");
  if (required == json.end() || !required->is_array()) return std::nullopt;
  for (const Json& name : *required) {
    if (!name.is_string() ||
        !absl::c_linear_search(kPacked, name.get_ref<const std::string&>())) {
      continue;
    }
    return MeshFault{
        "", absl::StrCat("its geometry is packed by ",
                         name.get_ref<const std::string&>(),
                         ", expected plain accessors: export it without "
                         "compression")};
  }
  return std::nullopt;
}

std::optional<MeshFault> CheckBuffers(const Json& json, bool is_binary) {
  const auto buffers = json.find("buffers");
  if (buffers == json.end() || !buffers->is_array()) return std::nullopt;
  for (std::size_t i = 0; i < buffers->size(); ++i) {
    const Json& buffer = (*buffers)[i];
    const bool has_uri = buffer.is_object() && buffer.contains("uri") &&
                         buffer["uri"].is_string() && buffer["uri"] != "";
    if (has_uri || (is_binary && i == 0)) continue;
    return MeshFault{absl::StrCat("buffer ", i, " (0-based)"),
                     "there is no uri, expected one"};
  }
  return std::nullopt;
}

std::optional<MeshFault> CheckJson(const Json& json, bool is_binary) {
  const Json asset = json.is_object() ? json.value("asset", Json()) : Json();
  const Json version =
      asset.is_object() ? asset.value("version", Json()) : Json();
  if (!version.is_string() ||
      !absl::StartsWith(version.get_ref<const std::string&>(), "2.")) {
    return MeshFault{
        "", absl::StrCat("asset.version is ",
                         version.is_string()
                             ? Quoted(version.get_ref<const std::string&>())
                             : "missing",
                         ", expected 2.0")};
  }
  if (auto fault = CheckExtensions(json)) return fault;
  return CheckBuffers(json, is_binary);
}

}  // namespace

std::optional<MeshFault> OpenGltf(absl::string_view bytes,
                                  GltfContainer* container) {
  // Sizes of the reader are of 32 bits.
  if (bytes.size() > std::numeric_limits<std::uint32_t>::max()) {
    return MeshFault{"", "the file is larger than 4 GiB, expected less"};
  }
  container->is_binary = absl::StartsWith(bytes, "glTF");
  container->json = bytes;
  if (container->is_binary) {
    if (auto fault = OpenBinary(bytes, &container->json)) return fault;
  } else {
    absl::ConsumePrefix(&container->json, "\xef\xbb\xbf");
  }
  Json json;
  const auto offset =
      static_cast<std::size_t>(container->json.data() - bytes.data());
  if (auto fault = ParseJson(container->json, offset, &json)) return fault;
  return CheckJson(json, container->is_binary);
}

}  // namespace isomatch
