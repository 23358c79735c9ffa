#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "client/api/isomatch_client.h"
#include "client/cli/terminal.h"
#include "client/files/vertex_colors.h"

namespace CLI {
class App;
}  // namespace CLI

namespace isomatch {

/// The files that `isomatch match` writes; empty for none. Extensions tell how
/// maps are written (client/files/map_file.h).
struct MatchOutputs {
  /// "-" is standard output, as text.
  std::string map = "-";
  std::string report;
  std::string precise;
  std::string confidence;
  std::string alternative;
  std::string functional_map;
  std::string mask_y;
};

/// Adds an option for each to `command`, which `outputs` outlives.
void AddMatchOutputs(CLI::App* command, MatchOutputs* outputs);

/// True when anything is to be written.
bool HasFiles(const MatchOutputs& outputs);

/// What the user should know about a result.
std::vector<std::string> ResultWarnings(const v1::ResultInfo& info);

/// Prints the verdict on terminal.err, in one line; with `quiet` only that of a
/// map that is not good.
void TellVerdict(const v1::Verdict& verdict, bool quiet,
                 const Terminal& terminal);

/// True when one of the maps is to be in colors.
bool NeedColors(const MatchOutputs& outputs);

/// What is known of the files of the meshes; both outlive it.
struct MeshFacts {
  /// Set only when a map is to be in colors.
  const TriangleMesh* mesh_x = nullptr;
  /// Set only when a map is to be in colors or with --precise.
  const TriangleMesh* mesh_y = nullptr;
  /// Colors of Y's vertices, for maps in colors; without them each vertex has
  /// a color that tells its place.
  std::optional<Colors> colors_y = {};
  /// Warnings from reading the files of the meshes, for the report.
  std::vector<std::string> warnings = {};
};

/// OK when all of them can be expected to be written and have an extension that
/// tells what is in them (or none), no two are one file and
/// none is one of the `inputs`. Asked before the long work. INVALID_ARGUMENT
/// names option and path.
absl::Status CheckOutputs(const MatchOutputs& outputs,
                          const std::vector<std::string>& inputs);

/// What has to be downloaded for them beside the map.
std::vector<v1::ResultPart> PartsFor(const MatchOutputs& outputs);

/// Writes them all, the map first. When the result has no alternative, there is
/// a warning on terminal.err in place of its file.
absl::Status WriteOutputs(const MatchOutputs& outputs, const MeshFacts& facts,
                          const MatchResult& result, const Terminal& terminal);

}  // namespace isomatch
