#include "client/cli/match_outputs.h"

#include <filesystem>
#include <map>
#include <system_error>
#include <utility>

#include <CLI/CLI.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/cli/command_support.h"
#include "client/cli/option_support.h"
#include "client/files/map_file.h"
#include "client/files/map_ply.h"
#include "client/files/text_file.h"
#include "client/job/job_labels.h"
#include "client/job/match_report.h"
#include "client/job/part_files.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

namespace fs = std::filesystem;

const std::string kNoFile;

struct Output {
  const char* option;
  const std::string& path;
};

/// Those that are files, the map first.
std::vector<Output> Files(const MatchOutputs& outputs) {
  std::vector<Output> files;
  for (const Output& output :
       {Output{"--output", outputs.map == "-" ? kNoFile : outputs.map},
        Output{"--report", outputs.report},
        Output{"--precise", outputs.precise},
        Output{"--confidence", outputs.confidence},
        Output{"--alternative", outputs.alternative},
        Output{"--functional-map", outputs.functional_map},
        Output{"--mask-y", outputs.mask_y}}) {
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

/// The bytes of a map's file. `confidence` is empty when it is not known.
std::string MapBytes(const std::string& path, const VertexMap& y_from_x,
                     absl::Span<const float> confidence, const MeshFacts& facts,
                     const v1::ResultInfo& info) {
  const MapFormat format = MapFormatOf(path);
  if (format != MapFormat::kPly) {
    return FormatMap(y_from_x, info.mesh_y().vertices(), format);
  }
  const Colors colors =
      facts.colors_y ? *facts.colors_y : PositionColors(*facts.mesh_y);
  return FormatMapPly(
      {*facts.mesh_x, *facts.mesh_y, y_from_x, colors, confidence});
}

absl::Status WriteMap(const std::string& path, const MeshFacts& facts,
                      const MatchResult& result, const Terminal& terminal) {
  if (path.empty()) return absl::OkStatus();
  if (path != "-") {
    return WriteFileAtomically(
        path, MapBytes(path, result.y_from_x,
                       result.confidence.value_or(std::vector<float>()), facts,
                       result.info));
  }
  terminal.out << FormatMap(result.y_from_x) << std::flush;
  return terminal.out ? absl::OkStatus()
                      : absl::UnavailableError(
                            "the map cannot be written to standard output");
}

absl::Status WriteAlternative(const std::string& path, const MeshFacts& facts,
                              const MatchResult& result,
                              const Terminal& terminal) {
  if (path.empty()) return absl::OkStatus();
  if (result.alternative) {
    return WriteFileAtomically(
        path, MapBytes(path, *result.alternative, {}, facts, result.info));
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

absl::Status CheckExtensions(const MatchOutputs& outputs) {
  static const std::vector<std::string> kMaps = {".txt", ".npy", ".json",
                                                 ".ply", ""};
  if (outputs.map != "-") {
    ISOMATCH_RETURN_IF_ERROR(CheckExtension("--output", outputs.map, kMaps));
  }
  ISOMATCH_RETURN_IF_ERROR(
      CheckExtension("--alternative", outputs.alternative, kMaps));
  ISOMATCH_RETURN_IF_ERROR(
      CheckExtension("--precise", outputs.precise, kTextExtensions));
  ISOMATCH_RETURN_IF_ERROR(
      CheckExtension("--confidence", outputs.confidence, kTextExtensions));
  ISOMATCH_RETURN_IF_ERROR(
      CheckExtension("--mask-y", outputs.mask_y, kTextExtensions));
  ISOMATCH_RETURN_IF_ERROR(CheckExtension(
      "--functional-map", outputs.functional_map, kJsonExtensions));
  return CheckExtension("--report", outputs.report, kJsonExtensions);
}

// Below it a second map is nearly as good as the chosen one.
constexpr double kLowSymmetryConfidence = 0.2;

}  // namespace

void AddMatchOutputs(CLI::App* command, MatchOutputs* outputs) {
  command
      ->add_option("-o,--output", outputs->map,
                   "MAP to write: .txt, .npy, .json or .ply; - is "
                   "standard output")
      ->capture_default_str();
  command->add_option("--precise", outputs->precise,
                      "Places between the vertices of Y, .txt");
  command->add_option("--confidence", outputs->confidence,
                      "How far to trust each line of MAP, 0 to 1, .txt");
  command->add_option("--alternative", outputs->alternative,
                      "MAP of the runner-up, as a rule a symmetric image");
  command->add_option("--mask-y", outputs->mask_y,
                      "Which vertices of Y have a counterpart, 1 or 0, .txt");
  command->add_option("--functional-map", outputs->functional_map,
                      "The map between eigenfunctions, .json");
  command->add_option("--report", outputs->report,
                      "Report on times, memory and quality, .json");
  for (const char* name :
       {"--output", "--precise", "--confidence", "--alternative", "--mask-y",
        "--functional-map", "--report"}) {
    command->get_option(name)->type_name(kFile)->group(kFilesGroup);
  }
}

bool NeedColors(const MatchOutputs& outputs) {
  return MapFormatOf(outputs.map) == MapFormat::kPly ||
         MapFormatOf(outputs.alternative) == MapFormat::kPly;
}

bool HasFiles(const MatchOutputs& outputs) {
  return outputs.map == "-" || !Files(outputs).empty();
}

void TellVerdict(const v1::Verdict& verdict, bool quiet,
                 const Terminal& terminal) {
  if (quiet && verdict.level() == v1::Verdict::LEVEL_GOOD) return;
  terminal.err << "verdict: " << VerdictText(verdict) << std::endl;
}

std::vector<std::string> ResultWarnings(const v1::ResultInfo& info) {
  std::vector<std::string> warnings(info.warnings().begin(),
                                    info.warnings().end());
  if (info.alternatives_size() > 0 &&
      info.symmetry_confidence() < kLowSymmetryConfidence) {
    warnings.push_back(absl::StrFormat(
        "the map may be a symmetric image: another one is nearly as good "
        "(symmetry confidence %.2f of 1), see --alternative",
        info.symmetry_confidence()));
  }
  return warnings;
}

absl::Status CheckOutputs(const MatchOutputs& outputs,
                          const std::vector<std::string>& inputs) {
  ISOMATCH_RETURN_IF_ERROR(CheckExtensions(outputs));
  std::map<std::string, const char*> option_of_file;
  for (const auto& [option, path] : Files(outputs)) {
    ISOMATCH_RETURN_IF_ERROR(CheckOutputFile(path));
    ISOMATCH_RETURN_IF_ERROR(CheckNotInput(option, path, inputs));
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
        std::pair(&outputs.functional_map, v1::RESULT_PART_FUNCTIONAL_MAP),
        std::pair(&outputs.mask_y, v1::RESULT_PART_MASK_Y)}) {
    if (!path->empty()) parts.push_back(part);
  }
  return parts;
}

absl::Status WriteOutputs(const MatchOutputs& outputs, const MeshFacts& facts,
                          const MatchResult& result, const Terminal& terminal) {
  ISOMATCH_RETURN_IF_ERROR(WriteMap(outputs.map, facts, result, terminal));
  if (!outputs.report.empty()) {
    ISOMATCH_RETURN_IF_ERROR(WriteFileAtomically(
        outputs.report, FormatReport(result, facts.warnings)));
  }
  ISOMATCH_RETURN_IF_ERROR(
      WriteAlternative(outputs.alternative, facts, result, terminal));
  ISOMATCH_RETURN_IF_ERROR(
      WritePart({"--precise", outputs.precise}, result.precise,
                [&](const std::vector<PrecisePoint>& points) {
                  return FormatPreciseMap(points, *facts.mesh_y);
                }));
  ISOMATCH_RETURN_IF_ERROR(WritePart({"--confidence", outputs.confidence},
                                     result.confidence, FormatConfidence));
  ISOMATCH_RETURN_IF_ERROR(
      WritePart({"--mask-y", outputs.mask_y}, result.matched_y, FormatMask));
  return WritePart({"--functional-map", outputs.functional_map},
                   result.functional_map, FormatFunctionalMap);
}

}  // namespace isomatch
