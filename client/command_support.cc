#include "client/command_support.h"

#include <filesystem>
#include <system_error>
#include <utility>

#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "client/mesh_file.h"
#include "core/base/status_macros.h"

namespace isomatch {

absl::StatusOr<TriangleMesh> LoadMesh(const std::string& path,
                                      const std::string& field,
                                      std::vector<std::string>* warnings) {
  ISOMATCH_ASSIGN_OR_RETURN(LoadedMesh loaded, ReadMesh(path, field));
  for (const std::string& warning : loaded.warnings) {
    warnings->push_back(absl::StrCat(field, ": '", path, "': ", warning));
  }
  return std::move(loaded.mesh);
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
