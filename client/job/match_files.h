#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/api/match_request.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// The files that a match reads; `landmarks` and `weld` empty for none.
struct MatchPaths {
  std::string x;
  std::string y;
  std::string landmarks;
  std::string weld;
};

/// Reads both meshes and the landmarks, and returns Y with the faces of its
/// file, for what numbers them. What is to be said about the files is appended
/// to `warnings`. Errors name X, Y or the file's line.
absl::StatusOr<TriangleMesh> ReadMatchFiles(const MatchPaths& files,
                                            MatchRequest* request,
                                            std::vector<std::string>* warnings);

}  // namespace isomatch
