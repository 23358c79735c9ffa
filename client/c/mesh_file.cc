#include <cstdint>
#include <utility>

#include "client/c/arguments.h"
#include "client/c/objects.h"
#include "client/files/mesh_file.h"
#include "core/base/status_macros.h"

isomatch_status isomatch_mesh_file_read(const char* path,
                                        isomatch_mesh_file** file,
                                        isomatch_error** error) {
  *file = nullptr;
  return isomatch::Guarded(error, [&]() -> absl::Status {
    if (path == nullptr) {
      return isomatch::Invalid("path", "NULL, expected a mesh file's");
    }
    ISOMATCH_ASSIGN_OR_RETURN(isomatch::LoadedMesh loaded,
                              isomatch::ReadMesh(path, "path"));
    auto* const read = new isomatch_mesh_file{
        std::move(loaded.mesh), {}, std::move(loaded.warnings)};
    read->mesh = {read->read.positions.data(), read->read.num_vertices(),
                  read->read.faces.data(), read->read.num_faces()};
    *file = read;
    return absl::OkStatus();
  });
}

void isomatch_mesh_file_free(isomatch_mesh_file* file) { delete file; }

const isomatch_mesh* isomatch_mesh_file_mesh(const isomatch_mesh_file* file) {
  return &file->mesh;
}

std::int64_t isomatch_mesh_file_num_warnings(const isomatch_mesh_file* file) {
  return static_cast<std::int64_t>(file->warnings.size());
}

const char* isomatch_mesh_file_warning(const isomatch_mesh_file* file,
                                       std::int64_t index) {
  if (index < 0 || index >= isomatch_mesh_file_num_warnings(file)) {
    return nullptr;
  }
  return file->warnings[static_cast<std::size_t>(index)].c_str();
}
