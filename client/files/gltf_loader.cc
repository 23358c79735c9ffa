#define TINYGLTF_IMPLEMENTATION
#include "client/files/gltf_loader.h"
#undef TINYGLTF_IMPLEMENTATION

#include <cstddef>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <system_error>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "client/files/gltf_container.h"
#include "client/files/input_file.h"
#include "client/files/text_file.h"

namespace isomatch {
namespace {

namespace fs = std::filesystem;

// The files that a text file may name.
struct Neighbors {
  /// Canonical; empty for none.
  std::string folder;
  /// Which was asked for and must not be read.
  std::string refused = {};
  /// Of all that were read: buffers may name one file again and again.
  std::int64_t total_bytes = 0;
};

bool NeighborExists(const std::string& path, void* data) {
  auto* const neighbors = static_cast<Neighbors*>(data);
  std::error_code error;
  // The library looks in the current folder, too.
  if (neighbors->folder.empty() || !absl::StartsWith(path, neighbors->folder) ||
      !fs::is_regular_file(path, error)) {
    return false;
  }
  if (IsBelow(path, neighbors->folder)) return true;
  neighbors->refused = path;
  return false;
}

bool ReadNeighbor(std::vector<unsigned char>* bytes, std::string* fault,
                  const std::string& path, void* data) {
  auto* const neighbors = static_cast<Neighbors*>(data);
  std::error_code error;
  const auto size = static_cast<std::int64_t>(fs::file_size(path, error));
  neighbors->total_bytes += size;
  if (error || size > MostUnpackedBytes() ||
      neighbors->total_bytes > MostUnpackedBytes()) {
    *fault = absl::StrCat("its files are too large, expected at most ",
                          MostUnpackedBytes(), " bytes");
    return false;
  }
  const absl::StatusOr<std::string> read = ReadFile(path, "a buffer of glTF");
  if (!read.ok()) {
    *fault = std::string(read.status().message());
    return false;
  }
  bytes->assign(read->begin(), read->end());
  return true;
}

std::string SamePath(const std::string& path, void*) { return path; }

}  // namespace

bool IsBelow(const std::string& path, const std::string& folder) {
  std::error_code error;
  const std::string found = fs::canonical(path, error).string();
  if (error) return false;
  const std::string below = fs::canonical(folder, error).string();
  return !error && absl::StartsWith(found, below == "/" ? below : below + "/");
}

std::optional<MeshFault> LoadGltf(absl::string_view bytes,
                                  const std::string& folder,
                                  isomatch_tinygltf::Model* model) {
  GltfContainer container;
  if (auto fault = OpenGltf(bytes, &container)) return fault;

  std::error_code error;
  Neighbors neighbors;
  if (!folder.empty()) {
    neighbors.folder = fs::canonical(folder, error).string();
  }
  isomatch_tinygltf::TinyGLTF loader;
  // Keeps a picture's bytes as they are. Those of a view, which was not
  // compared with its buffer, are looked up later.
  loader.SetImageLoader(
      [](auto* image, int, auto*, auto*, int, int, const unsigned char* first,
         int size, void*) {
        if (image->bufferView < 0) image->image.assign(first, first + size);
        return true;
      },
      nullptr);
  loader.SetFsCallbacks(
      {NeighborExists, SamePath, ReadNeighbor, nullptr, &neighbors});
  std::string fault;
  std::string warning;
  bool is_loaded = false;
  try {
    is_loaded =
        container.is_binary
            ? loader.LoadBinaryFromMemory(
                  model, &fault, &warning,
                  reinterpret_cast<const unsigned char*>(bytes.data()),
                  static_cast<unsigned int>(bytes.size()), neighbors.folder)
            : loader.LoadASCIIFromString(
                  model, &fault, &warning, container.json.data(),
                  static_cast<unsigned int>(container.json.size()),
                  neighbors.folder);
  } catch (const std::exception& exception) {
    fault = exception.what();
  }
  if (is_loaded) return std::nullopt;
  if (!neighbors.refused.empty()) {
    return MeshFault{"", absl::StrCat("it names ", Quoted(neighbors.refused),
                                      ", expected files below its own "
                                      "folder only")};
  }
  std::vector<std::string> lines =
      absl::StrSplit(fault, '\n', absl::SkipWhitespace());
  constexpr std::size_t kMostShown = 200;
  return MeshFault{
      "",
      absl::StrCat("tinygltf cannot load it: ",
                   lines.empty() ? "no reason" : lines[0].substr(0, kMostShown),
                   ", expected glTF 2.0 with buffers that are whole")};
}

}  // namespace isomatch
