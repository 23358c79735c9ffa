#include "client/files/mesh_input.h"

#include <optional>

#include "absl/strings/str_cat.h"
#include "client/files/mesh_weld.h"
#include "core/base/status_macros.h"

namespace isomatch {

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

}  // namespace isomatch
