#include "client/job/match_files.h"

#include <utility>

#include "client/files/map_file.h"
#include "client/files/mesh_input.h"
#include "core/base/status_macros.h"

namespace isomatch {

absl::StatusOr<FileOfY> ReadMatchFiles(const MatchPaths& files,
                                       MatchRequest* request,
                                       std::vector<std::string>* warnings) {
  ISOMATCH_ASSIGN_OR_RETURN(LoadedMesh x,
                            LoadMesh(files.x, "X", files.weld, warnings));
  ISOMATCH_ASSIGN_OR_RETURN(LoadedMesh y,
                            LoadMesh(files.y, "Y", files.weld, warnings));
  TriangleMesh with_file_faces = y.WithFileFaces();
  request->mesh_x = std::move(x.mesh);
  request->mesh_y = std::move(y.mesh);
  if (!files.landmarks.empty()) {
    ISOMATCH_ASSIGN_OR_RETURN(
        request->landmarks,
        ReadLandmarks(files.landmarks, request->mesh_x.num_vertices(),
                      request->mesh_y.num_vertices()));
  }
  return FileOfY{std::move(with_file_faces), std::move(y.colors)};
}

}  // namespace isomatch
