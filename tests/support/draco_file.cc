#include "tests/support/draco_file.h"

#include <fstream>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/io/draco_mesh.h"

namespace isomatch {

absl::StatusOr<TriangleMesh> ReadDracoFile(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    return absl::NotFoundError(absl::StrCat("'", path, "': cannot be opened"));
  }
  std::ostringstream content;
  content << file.rdbuf();
  const std::string bytes = content.str();
  const VertexOrder order = RenumbersVertices(bytes) ? VertexOrder::kIdAttribute
                                                     : VertexOrder::kDecoded;
  absl::StatusOr<TriangleMesh> mesh =
      DecodeDraco(bytes, order, /*vertex_count=*/0);
  if (mesh.ok()) return mesh;
  return absl::Status(mesh.status().code(),
                      absl::StrCat("'", path, "': ", mesh.status().message()));
}

absl::Status WriteDracoFile(const std::string& path, const TriangleMesh& mesh) {
  ISOMATCH_ASSIGN_OR_RETURN(const EncodedMesh encoded, EncodeDraco(mesh));
  std::ofstream file(path, std::ios::binary);
  file << encoded.bytes << std::flush;
  if (file) return absl::OkStatus();
  return absl::UnavailableError(
      absl::StrCat("'", path, "': cannot be written"));
}

}  // namespace isomatch
