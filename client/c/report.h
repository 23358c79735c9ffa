#pragma once

#include <string>
#include <vector>

#include "core/mesh/mesh_size.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/match_options.h"

namespace isomatch {

/// What was matched.
struct Matched {
  MeshSize x;
  MeshSize y;
  std::vector<Landmark> landmarks;
};

/// Returns the fields of the command line's REPORT.json, but times and memory;
/// warnings of the meshes begin with "X: " or "Y: ".
std::string FormatReport(const Correspondence& found, const Matched& matched,
                         const MatchOptions& options);

}  // namespace isomatch
