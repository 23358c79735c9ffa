#include "client/files/mesh_input.h"

#include <future>
#include <optional>
#include <utility>

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
    loaded.faces_before_weld = loaded.mesh.faces;
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

absl::StatusOr<LoadedPair> LoadMeshes(const std::string& path_x,
                                      const std::string& path_y,
                                      const std::string& weld,
                                      std::vector<std::string>* warnings) {
  std::future<absl::StatusOr<LoadedMesh>> x =
      std::async([&] { return LoadMeshFile(path_x, "X", weld); });
  absl::StatusOr<LoadedMesh> y = LoadMeshFile(path_y, "Y", weld);
  LoadedPair pair;
  ISOMATCH_ASSIGN_OR_RETURN(pair.x, x.get());
  ISOMATCH_ASSIGN_OR_RETURN(pair.y, std::move(y));
  for (const std::string& warning : pair.x.warnings) {
    warnings->push_back(absl::StrCat("X: '", path_x, "': ", warning));
  }
  for (const std::string& warning : pair.y.warnings) {
    warnings->push_back(absl::StrCat("Y: '", path_y, "': ", warning));
  }
  return pair;
}

}  // namespace isomatch
