#pragma once

#include <string>
#include <vector>

#include <CLI/CLI.hpp>

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

/// Adds an option for each to `command`, which `outputs` outlives.
void AddMatchOutputs(CLI::App* command, MatchOutputs* outputs);

/// True when anything is to be written.
bool HasFiles(const MatchOutputs& outputs);

/// What the user should know about a result.
std::vector<std::string> ResultWarnings(const v1::ResultInfo& info);

/// OK when all of them can be expected to be written, and no two are one file.
/// Asked before the long work. INVALID_ARGUMENT names option and path.
absl::Status CheckOutputs(const MatchOutputs& outputs);

/// What has to be downloaded for them beside the map.
std::vector<v1::ResultPart> PartsFor(const MatchOutputs& outputs);

/// Writes them all, the map first. When the result has no alternative, there is
/// a warning on terminal.err in place of its file. `mesh_y` is asked for its
/// faces by --precise only. `warnings` are those of reading the meshes, for the
/// report.
absl::Status WriteOutputs(const MatchOutputs& outputs,
                          const TriangleMesh& mesh_y, const MatchResult& result,
                          const std::vector<std::string>& warnings,
                          const Terminal& terminal);

}  // namespace isomatch
