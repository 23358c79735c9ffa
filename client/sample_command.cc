#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "client/commands.h"
#include "client/map_file.h"
#include "client/mesh_file.h"
#include "client/sample_animal.h"
#include "client/text_file.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

constexpr char kFooter[] = R"(
Makes one animal in three near-isometric poses: A standing, B walking, C looking
back. Each pose and each --mesh-seed has a triangulation and a vertex order of
its own. The same options give the same file, so a ground truth needs only to
know how the other mesh was made.

Examples:

  isomatch sample --pose A --vertices 5000 -o a.off
  isomatch sample --pose B --vertices 4000 -o b.off \
      --truth-from A:5000 --truth truth.txt
  isomatch match a.off b.off -o map.txt
  isomatch evaluate b.off map.txt truth.txt

truth.txt has for each vertex of a.off its true vertex of b.off.
--truth-from is POSE:VERTICES, or POSE:VERTICES:MESH_SEED when that is not 1.)";

struct Arguments {
  std::string pose = "A";
  int vertices = 5000;
  std::uint64_t mesh_seed = 1;
  std::string output;
  std::string truth_from;
  std::string truth;
};

// Reads a pose's name, which has one letter.
absl::StatusOr<char> ParsePose(const std::string& option,
                               absl::string_view text) {
  if (text.size() == 1) return absl::ascii_toupper(text[0]);
  return absl::InvalidArgumentError(
      absl::StrCat(option, ": pose is '", text, "', expected A, B or C"));
}

absl::StatusOr<SampleOptions> ParseTruthFrom(const std::string& text) {
  const std::vector<std::string> parts = absl::StrSplit(text, ':');
  SampleOptions options;
  const bool parsed =
      (parts.size() == 2 || parts.size() == 3) &&
      absl::SimpleAtoi(parts[1], &options.vertices) &&
      (parts.size() == 2 || absl::SimpleAtoi(parts[2], &options.mesh_seed));
  if (!parsed) {
    return absl::InvalidArgumentError(
        absl::StrCat("--truth-from is '", text,
                     "', expected POSE:VERTICES or POSE:VERTICES:MESH_SEED, "
                     "e.g. A:5000"));
  }
  ISOMATCH_ASSIGN_OR_RETURN(options.pose, ParsePose("--truth-from", parts[0]));
  return options;
}

absl::StatusOr<SampleOptions> ParseOptions(const Arguments& arguments) {
  SampleOptions options;
  ISOMATCH_ASSIGN_OR_RETURN(options.pose, ParsePose("--pose", arguments.pose));
  options.vertices = arguments.vertices;
  options.mesh_seed = arguments.mesh_seed;
  ISOMATCH_RETURN_IF_ERROR(options.Validate());
  return options;
}

absl::Status CheckOutputs(const Arguments& arguments) {
  if (arguments.truth.empty() != arguments.truth_from.empty()) {
    return absl::InvalidArgumentError(
        "--truth FILE and --truth-from POSE:VERTICES belong together, found "
        "one of them");
  }
  ISOMATCH_RETURN_IF_ERROR(CheckMeshOutput(arguments.output));
  return arguments.truth.empty() ? absl::OkStatus()
                                 : CheckOutputFile(arguments.truth);
}

absl::Status Run(const Arguments& arguments) {
  ISOMATCH_RETURN_IF_ERROR(CheckOutputs(arguments));
  ISOMATCH_ASSIGN_OR_RETURN(const SampleOptions options,
                            ParseOptions(arguments));
  std::string truth;
  ISOMATCH_ASSIGN_OR_RETURN(const Sample sample, MakeSample(options));
  if (!arguments.truth_from.empty()) {
    ISOMATCH_ASSIGN_OR_RETURN(const SampleOptions from,
                              ParseTruthFrom(arguments.truth_from));
    ISOMATCH_ASSIGN_OR_RETURN(const Sample x, MakeSample(from));
    truth = FormatMap(SampleTruth(x, sample));
  }
  ISOMATCH_RETURN_IF_ERROR(WriteMesh(arguments.output, sample.mesh));
  return truth.empty() ? absl::OkStatus()
                       : WriteFileAtomically(arguments.truth, truth);
}

}  // namespace

Command AddSampleCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "sample", "Writes a procedural animal, and the truth about a pair.");
  const auto arguments = std::make_shared<Arguments>();
  command->add_option("--pose", arguments->pose, "A, B or C")
      ->capture_default_str();
  command
      ->add_option("--vertices", arguments->vertices,
                   "100 to 5000000, met exactly")
      ->capture_default_str();
  command
      ->add_option("--mesh-seed", arguments->mesh_seed,
                   "Another seed gives another triangulation")
      ->capture_default_str();
  command
      ->add_option("-o,--output", arguments->output,
                   "Mesh to write, .off or .ply")
      ->required();
  command->add_option("--truth-from", arguments->truth_from,
                      "POSE:VERTICES[:MESH_SEED] of the mesh the truth is for");
  command->add_option("--truth", arguments->truth,
                      "Ground truth to write, from that mesh to this one");
  command->footer(kFooter);
  return {command, [arguments](const Terminal&) { return Run(*arguments); }};
}

}  // namespace isomatch
