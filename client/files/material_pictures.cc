#include "client/files/material_pictures.h"

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <map>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "client/files/text_file.h"

namespace isomatch {
namespace {

// The file that `map_Kd` names: what follows it, of which the last word when
// options stand before it.
std::string PictureName(absl::string_view rest) {
  if (absl::StartsWith(rest, "-")) rest = SplitWords(rest).back();
  std::string name(rest);
  std::replace(name.begin(), name.end(), '\\', '/');
  return name;
}

// The picture's path of each material of a .mtl file.
std::map<std::string, std::string> PicturePaths(const std::string& library,
                                                absl::string_view text) {
  std::map<std::string, std::string> paths;
  std::string material;
  for (LineCursor lines = {text}; lines.Next();) {
    const absl::string_view keyword = SplitWords(lines.line).front();
    const absl::string_view rest =
        absl::StripAsciiWhitespace(lines.line.substr(keyword.size()));
    if (keyword == "newmtl") {
      material = std::string(rest);
    } else if (absl::EqualsIgnoreCase(keyword, "map_Kd") && !rest.empty()) {
      const std::filesystem::path folder =
          std::filesystem::path(library).parent_path();
      paths.emplace(material, (folder / PictureName(rest)).string());
    }
  }
  return paths;
}

bool IsPicture(absl::string_view bytes) {
  return absl::StartsWith(bytes, "\x89PNG") ||
         absl::StartsWith(bytes, "\xff\xd8\xff");
}

// The bytes of a picture that is at `path`, or is `bytes`.
std::string Picture(const std::string& path, std::string bytes,
                    std::vector<std::string>* warnings) {
  if (!path.empty()) {
    absl::StatusOr<std::string> read = ReadFile(path, "a picture");
    if (!read.ok()) {
      warnings->push_back(
          absl::StrCat("a picture is not embedded: ", read.status().message()));
      return "";
    }
    bytes = *std::move(read);
  }
  if (bytes.empty() || IsPicture(bytes)) return bytes;
  warnings->push_back(
      absl::StrCat("a picture is not embedded: '", path,
                   "' is neither PNG nor JPEG, which glTF expects"));
  return "";
}

std::map<std::string, std::string> PathsOfLibraries(
    const MeshTexture& texture, std::vector<std::string>* warnings) {
  std::map<std::string, std::string> paths;
  for (const std::string& library : texture.libraries) {
    const absl::StatusOr<std::string> text = ReadFile(library, "materials");
    if (!text.ok()) {
      warnings->push_back(
          absl::StrCat("pictures are not embedded: ", text.status().message()));
      continue;
    }
    paths.merge(PicturePaths(library, *text));
  }
  return paths;
}

}  // namespace

std::vector<std::string> MaterialPictures(const MeshTexture& texture,
                                          std::vector<std::string>* warnings) {
  const std::map<std::string, std::string> paths =
      PathsOfLibraries(texture, warnings);
  std::vector<std::string> pictures;
  for (std::size_t m = 0; m < texture.materials.size(); ++m) {
    MeshTexture::Image image;
    if (m < texture.image_of_material.size()) {
      const int number = texture.image_of_material[m];
      if (number >= 0) image = texture.images[static_cast<std::size_t>(number)];
    } else if (const auto found = paths.find(texture.materials[m]);
               found != paths.end()) {
      image.path = found->second;
    }
    pictures.push_back(Picture(image.path, std::move(image.bytes), warnings));
  }
  return pictures;
}

}  // namespace isomatch
