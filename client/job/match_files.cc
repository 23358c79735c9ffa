#include "client/job/match_files.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "client/files/input_file.h"
#include "client/files/landmark_points.h"
#include "client/files/map_file.h"
#include "client/files/mesh_input.h"
#include "client/files/text_file.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

absl::Status ReadMatchLandmarks(const LandmarkPaths& files,
                                MatchRequest* request,
                                std::vector<std::string>* notes,
                                std::vector<std::string>* warnings) {
  // Lines `x y` may have any name, but for these, which are 3D Slicer's.
  const std::string extension = LowerExtension(WithoutGz(files.pairs));
  if (extension == ".json" || extension == ".fcsv") {
    return absl::InvalidArgumentError(
        absl::StrCat("'", files.pairs,
                     "' has points on one shape, expected lines `x y`, or "
                     "--landmarks-x and --landmarks-y"));
  }
  if (!files.pairs.empty()) {
    ISOMATCH_ASSIGN_OR_RETURN(
        request->landmarks,
        ReadLandmarks(files.pairs, request->mesh_x.num_vertices(),
                      request->mesh_y.num_vertices()));
  }
  if (files.points_x.empty()) return absl::OkStatus();
  ISOMATCH_ASSIGN_OR_RETURN(
      const SnappedPoints x,
      ReadSnappedPoints(files.points_x, request->mesh_x, "X"));
  ISOMATCH_ASSIGN_OR_RETURN(
      const SnappedPoints y,
      ReadSnappedPoints(files.points_y, request->mesh_y, "Y"));
  for (const SnappedPoints* points : {&x, &y}) {
    notes->push_back(points->summary);
    warnings->insert(warnings->end(), points->warnings.begin(),
                     points->warnings.end());
  }
  ISOMATCH_ASSIGN_OR_RETURN(
      request->landmarks,
      PairPoints(
          x, y,
          absl::StrCat("'", files.points_x, "' and '", files.points_y, "'"),
          warnings));
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<FileOfY> ReadMatchFiles(const MatchPaths& files,
                                       MatchRequest* request,
                                       std::vector<std::string>* warnings) {
  ISOMATCH_ASSIGN_OR_RETURN(LoadedPair meshes,
                            LoadMeshes(files.x, files.y, files.weld, warnings));
  auto& [x, y] = meshes;
  FileOfY file_y = {.colors = std::move(y.colors)};
  if (y.faces_before_weld) file_y.unwelded = y.WithFileFaces();
  request->mesh_x = std::move(x.mesh);
  request->mesh_y = std::move(y.mesh);
  ISOMATCH_RETURN_IF_ERROR(
      ReadMatchLandmarks(files.landmarks, request, &file_y.notes, warnings));
  return file_y;
}

}  // namespace isomatch
