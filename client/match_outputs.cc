#include "client/match_outputs.h"

#include <filesystem>
#include <map>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "client/map_file.h"
#include "client/map_ply.h"
#include "client/match_report.h"
#include "client/part_files.h"
#include "client/text_file.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

namespace fs = std::filesystem;

struct Output {
  const char* option;
  const std::string& path;
};

/// Those that are files, the map first.
std::vector<Output> Files(const MatchOutputs& outputs) {
  std::vector<Output> files;
  if (outputs.map != "-") files.push_back({"--output", outputs.map});
  for (const Output& output :
       {Output{"--report", outputs.report},
        Output{"--precise", outputs.precise},
        Output{"--confidence", outputs.confidence},
        Output{"--alternative", outputs.alternative},
        Output{"--functional-map", outputs.functional_map}}) {
    if (!output.path.empty()) files.push_back(output);
  }
  return files;
}

/// The same for two ways to write a path. Devices, such as /dev/null, may be
/// written more than once: empty.
std::string Identity(const std::string& path) {
  std::error_code error;
  if (fs::exists(path, error) && !fs::is_regular_file(path, error)) return "";
  const fs::path canonical = fs::weakly_canonical(path, error);
  return error ? path : canonical.string();
}

/// What maps of one result are made files from.
struct MapContext {
  const MatchRequest& request;
  const MatchResult& result;
  const MeshFacts& facts;
};

std::string MapBytes(const std::string& path, const VertexMap& y_from_x,
                     const MapContext& context) {
  const MapFormat format = MapFormatOf(path);
  const TriangleMesh& mesh_y = context.request.mesh_y;
  if (format != MapFormat::kPly) {
    return FormatMap(y_from_x, mesh_y.num_vertices(), format);
  }
  const Colors colors = context.facts.colors_y
                            ? *context.facts.colors_y
                            : PositionColors(mesh_y.positions);
  MapPicture picture = {context.request.mesh_x, mesh_y, y_from_x, colors, {}};
  if (context.result.confidence)
    picture.confidence = *context.result.confidence;
  return FormatMapPly(picture);
}

absl::Status WriteMap(const std::string& path, const MapContext& context,
                      const Terminal& terminal) {
  const VertexMap& y_from_x = context.result.y_from_x;
  if (path != "-") {
    return WriteFileAtomically(path, MapBytes(path, y_from_x, context));
  }
  terminal.out << FormatMap(y_from_x) << std::flush;
  return terminal.out ? absl::OkStatus()
                      : absl::UnavailableError(
                            "the map cannot be written to standard output");
}

absl::Status WriteAlternative(const std::string& path,
                              const MapContext& context,
                              const Terminal& terminal) {
  if (path.empty()) return absl::OkStatus();
  if (const auto& alternative = context.result.alternative) {
    // How far to trust it is not known.
    MatchResult without_confidence;
    return WriteFileAtomically(
        path, MapBytes(path, *alternative,
                       {context.request, without_confidence, context.facts}));
  }
  terminal.err << "isomatch: warning: --alternative '" << path
               << "' is not written: no other map came near this one"
               << std::endl;
  return absl::OkStatus();
}

/// Writes format(*part), if the user wants the file.
template <typename Part, typename Format>
absl::Status WritePart(const Output& output, const Part& part,
                       const Format& format) {
  if (output.path.empty()) return absl::OkStatus();
  if (part) return WriteFileAtomically(output.path, format(*part));
  return absl::UnimplementedError(
      absl::StrCat(output.option, " '", output.path,
                   "': the server's result has no such part, expected a newer "
                   "isomatch-server"));
}

}  // namespace

bool NeedColors(const MatchOutputs& outputs) {
  return MapFormatOf(outputs.map) == MapFormat::kPly ||
         MapFormatOf(outputs.alternative) == MapFormat::kPly;
}

absl::Status CheckOutputs(const MatchOutputs& outputs) {
  std::map<std::string, const char*> option_of_file;
  for (const auto& [option, path] : Files(outputs)) {
    ISOMATCH_RETURN_IF_ERROR(CheckOutputFile(path));
    const std::string identity = Identity(path);
    if (identity.empty()) continue;
    const auto [entry, is_new] = option_of_file.emplace(identity, option);
    if (is_new) continue;
    return absl::InvalidArgumentError(
        absl::StrCat(option, " '", path, "': is the file of ", entry->second,
                     " too, expected another"));
  }
  return absl::OkStatus();
}

std::vector<v1::ResultPart> PartsFor(const MatchOutputs& outputs) {
  std::vector<v1::ResultPart> parts;
  for (const auto& [path, part] :
       {std::pair(&outputs.precise, v1::RESULT_PART_PRECISE_MAP),
        std::pair(&outputs.confidence, v1::RESULT_PART_CONFIDENCE),
        std::pair(&outputs.alternative, v1::RESULT_PART_ALTERNATIVE_MAP),
        std::pair(&outputs.functional_map, v1::RESULT_PART_FUNCTIONAL_MAP)}) {
    if (!path->empty()) parts.push_back(part);
  }
  return parts;
}

absl::Status WriteOutputs(const MatchOutputs& outputs,
                          const MatchRequest& request,
                          const MatchResult& result, const MeshFacts& facts,
                          const Terminal& terminal) {
  const MapContext context = {request, result, facts};
  ISOMATCH_RETURN_IF_ERROR(WriteMap(outputs.map, context, terminal));
  if (!outputs.report.empty()) {
    ISOMATCH_RETURN_IF_ERROR(WriteFileAtomically(
        outputs.report, FormatReport(request, result, facts.warnings)));
  }
  ISOMATCH_RETURN_IF_ERROR(
      WriteAlternative(outputs.alternative, context, terminal));
  ISOMATCH_RETURN_IF_ERROR(
      WritePart({"--precise", outputs.precise}, result.precise,
                [&](const std::vector<PrecisePoint>& points) {
                  return FormatPreciseMap(points, request.mesh_y);
                }));
  ISOMATCH_RETURN_IF_ERROR(WritePart({"--confidence", outputs.confidence},
                                     result.confidence, FormatConfidence));
  return WritePart({"--functional-map", outputs.functional_map},
                   result.functional_map, FormatFunctionalMap);
}

}  // namespace isomatch
