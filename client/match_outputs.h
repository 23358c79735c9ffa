#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "client/command_line.h"
#include "client/isomatch_client.h"

namespace isomatch {

/// The files that `isomatch match` writes; empty for none.
struct MatchOutputs {
  /// "-" is standard output.
  std::string map = "-";
  std::string report;
  std::string precise;
  std::string confidence;
  std::string alternative;
  std::string functional_map;
};

/// OK when all of them can be expected to be written, and no two are one file.
/// Asked before the long work. INVALID_ARGUMENT names option and path.
absl::Status CheckOutputs(const MatchOutputs& outputs);

/// What has to be downloaded for them beside the map.
std::vector<v1::ResultPart> PartsFor(const MatchOutputs& outputs);

/// Writes them all, the map first. When the result has no alternative, there is
/// a warning on terminal.err in place of its file. `warnings` are those of
/// reading the meshes, for the report.
absl::Status WriteOutputs(const MatchOutputs& outputs,
                          const MatchRequest& request,
                          const MatchResult& result,
                          const std::vector<std::string>& warnings,
                          const Terminal& terminal);

}  // namespace isomatch
