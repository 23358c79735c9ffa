#include "client/command_support.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <set>
#include <system_error>
#include <utility>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/mesh_file.h"
#include "client/mesh_weld.h"
#include "client/option_support.h"
#include "client/text_file.h"
#include "core/base/status_macros.h"

namespace isomatch {

void AddWeldOption(CLI::App* command, std::string* weld) {
  command
      ->add_option("--weld", *weld,
                   "Take vertices nearer than this for one: a length in mesh "
                   "units, or with % a part of the bounding box's diagonal")
      ->type_name("TOLERANCE")
      ->group(kMethodGroup);
}

absl::StatusOr<LoadedMesh> LoadMeshFile(const std::string& path,
                                        const std::string& field,
                                        const std::string& weld) {
  WeldTolerance tolerance;
  if (!weld.empty()) {
    ISOMATCH_ASSIGN_OR_RETURN(tolerance, ParseWeldTolerance(weld));
  }
  ISOMATCH_ASSIGN_OR_RETURN(LoadedMesh loaded, ReadMesh(path, field));
  if (!weld.empty()) {
    const absl::StatusOr<VertexIndex> moved =
        WeldVertices(tolerance, &loaded.mesh);
    if (!moved.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat(field, ": '", path, "': ", moved.status().message()));
    }
    if (*moved > 0) {
      loaded.warnings.push_back(
          absl::StrCat(*moved, " vertices were moved to others within ",
                       tolerance.LengthFor(loaded.mesh), ", as --weld says"));
    }
  }
  if (const std::optional<WeldAdvice> advice = AdviseWeld(loaded.mesh)) {
    loaded.warnings.push_back(advice->Text());
  }
  return loaded;
}

absl::StatusOr<LoadedMesh> LoadMesh(const std::string& path,
                                    const std::string& field,
                                    const std::string& weld,
                                    std::vector<std::string>* warnings) {
  ISOMATCH_ASSIGN_OR_RETURN(LoadedMesh loaded, LoadMeshFile(path, field, weld));
  for (const std::string& warning : loaded.warnings) {
    warnings->push_back(absl::StrCat(field, ": '", path, "': ", warning));
  }
  return loaded;
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
