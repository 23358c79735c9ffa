#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/api/match_request.h"
#include "client/files/mesh_file.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// Where landmarks come from; empty for none.
struct LandmarkPaths {
  /// Lines `x y`.
  std::string pairs;
  /// Points on X and on Y, both or none.
  std::string points_x;
  std::string points_y;
};

/// The files that a match reads; `weld` empty for none.
struct MatchPaths {
  std::string x;
  std::string y;
  LandmarkPaths landmarks;
  std::string weld;
};

/// Y as its file has it, for what numbers its faces or shows its colors.
struct FileOfY {
  /// With the faces of the file, where a weld changed those of the request.
  std::optional<TriangleMesh> unwelded = {};
  /// Of each vertex of its file, or why there are none.
  absl::StatusOr<std::optional<Colors>> colors;
  /// How far points were from the surfaces, in lines for people.
  std::vector<std::string> notes = {};

  const TriangleMesh& MeshIn(const MatchRequest& request) const {
    return unwelded ? *unwelded : request.mesh_y;
  }
};

/// Reads both meshes and the landmarks into `request`. What is to be said about
/// the files is appended to `warnings`. Errors name X, Y or the file's line.
absl::StatusOr<FileOfY> ReadMatchFiles(const MatchPaths& files,
                                       MatchRequest* request,
                                       std::vector<std::string>* warnings);

}  // namespace isomatch
