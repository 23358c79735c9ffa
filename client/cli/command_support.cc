#include "client/cli/command_support.h"

#include <algorithm>
#include <filesystem>
#include <set>
#include <system_error>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/cli/option_support.h"
#include "client/files/text_file.h"

namespace isomatch {

void AddWeldOption(CLI::App* command, std::string* weld) {
  command
      ->add_option("--weld", *weld,
                   "Take vertices nearer than this for one: a length in mesh "
                   "units, or with % a part of the bounding box's diagonal")
      ->type_name("TOLERANCE")
      ->group(kMethodGroup);
}

namespace {

// Names under which other programs, or other commands, expect other contents.
bool IsOfAFormat(const std::string& extension) {
  static const std::set<std::string> kFormats = {
      ".3ds",  ".bmp", ".csv", ".dae",  ".drc",  ".fbx",  ".gif",  ".glb",
      ".gltf", ".gz",  ".htm", ".html", ".jpeg", ".jpg",  ".json", ".mat",
      ".msh",  ".npy", ".npz", ".obj",  ".off",  ".pdf",  ".pkl",  ".ply",
      ".png",  ".pt",  ".py",  ".stl",  ".svg",  ".tif",  ".tiff", ".toml",
      ".txt",  ".vtk", ".vtp", ".webp", ".xml",  ".yaml", ".zip"};
  return kFormats.count(extension) > 0;
}

}  // namespace

absl::Status CheckExtension(const std::string& option, const std::string& path,
                            const std::vector<std::string>& allowed) {
  const std::string extension = LowerExtension(path);
  const auto is_allowed = [&](const std::string& name) {
    return std::find(allowed.begin(), allowed.end(), name) != allowed.end();
  };
  const bool none = is_allowed("");
  if (path.empty() || is_allowed(extension) ||
      (none && !IsOfAFormat(extension))) {
    return absl::OkStatus();
  }
  std::vector<std::string> names = allowed;
  std::erase(names, "");
  return absl::InvalidArgumentError(absl::StrCat(
      option, " '", path, "': the extension is '", extension, "', expected ",
      absl::StrJoin(names, " or "), none ? ", or no extension" : ""));
}

absl::Status PrintJson(const nlohmann::ordered_json& json,
                       const Terminal& terminal) {
  constexpr int kIndent = 2;
  return Print(json.dump(kIndent, ' ', /*ensure_ascii=*/false,
                         nlohmann::ordered_json::error_handler_t::replace) +
                   "\n",
               terminal);
}

absl::Status CheckNotInput(const std::string& option, const std::string& output,
                           const std::vector<std::string>& inputs) {
  for (const std::string& input : inputs) {
    std::error_code error;
    if (!std::filesystem::equivalent(output, input, error) || error) continue;
    return absl::InvalidArgumentError(
        absl::StrCat(option, " '", output,
                     "': is a file that is read too, expected another"));
  }
  return absl::OkStatus();
}

}  // namespace isomatch
