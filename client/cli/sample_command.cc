#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "absl/status/statusor.h"
#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "client/cli/command_support.h"
#include "client/cli/commands.h"
#include "client/cli/option_support.h"
#include "client/files/glb_file.h"
#include "client/files/map_file.h"
#include "client/files/mesh_file.h"
#include "client/files/obj_file.h"
#include "client/files/ply_file.h"
#include "client/files/text_file.h"
#include "client/picture/image.h"
#include "client/sample/sample_animal.h"
#include "client/sample/sample_texture.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

namespace fs = std::filesystem;

constexpr char kSampleFooter[] = R"(
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

  isomatch sample --pose B --vertices 4000 -o b.obj --texture checker
  isomatch transfer a.off b.obj map.txt -o textured_a.obj

truth.txt has for each vertex of a.off its true vertex of b.off. --texture makes
a pattern, warm on the left side and cold on the right: in b.obj, b.mtl and
b.png, in b.glb alone, or as colors of the vertices of b.ply.
--truth-from is POSE:VERTICES, or POSE:VERTICES:MESH_SEED when that is not 1.)";

struct SampleArguments {
  std::string pose = "A";
  int vertices = 5000;
  std::uint64_t mesh_seed = 1;
  std::string output;
  std::string texture;
  std::string truth_from;
  std::string truth;
  bool json = false;
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

absl::StatusOr<SampleOptions> ParseOptions(const SampleArguments& arguments) {
  SampleOptions options;
  ISOMATCH_ASSIGN_OR_RETURN(options.pose, ParsePose("--pose", arguments.pose));
  options.vertices = arguments.vertices;
  options.mesh_seed = arguments.mesh_seed;
  ISOMATCH_RETURN_IF_ERROR(options.Validate());
  return options;
}

absl::Status CheckTextureOutput(const std::string& path) {
  const std::string extension = LowerExtension(path);
  if (extension != ".obj" && extension != ".ply" && extension != ".glb") {
    return absl::InvalidArgumentError(
        absl::StrCat("'", path, "': the extension is '", extension,
                     "', expected .obj, .glb or .ply with --texture"));
  }
  return CheckOutputFile(path);
}

absl::Status CheckOutputs(const SampleArguments& arguments) {
  if (arguments.truth.empty() != arguments.truth_from.empty()) {
    return absl::InvalidArgumentError(
        "--truth FILE and --truth-from POSE:VERTICES belong together, found "
        "one of them");
  }
  if (arguments.texture.empty()) {
    ISOMATCH_RETURN_IF_ERROR(CheckMeshOutput(arguments.output));
  } else {
    ISOMATCH_RETURN_IF_ERROR(CheckTextureOutput(arguments.output));
  }
  ISOMATCH_RETURN_IF_ERROR(
      CheckExtension("--truth", arguments.truth, kTextExtensions));
  return arguments.truth.empty() ? absl::OkStatus()
                                 : CheckOutputFile(arguments.truth);
}

// An .obj file with its .mtl and .png beside it.
absl::Status WriteTexturedObj(const std::string& path, const Sample& sample,
                              SamplePattern pattern) {
  const fs::path library = fs::path(path).replace_extension(".mtl");
  const fs::path png = fs::path(path).replace_extension(".png");
  const MeshTexture texture = SampleTexture(sample, library.string());
  ISOMATCH_ASSIGN_OR_RETURN(const std::string picture,
                            EncodePng(SamplePicture(pattern)));
  ISOMATCH_RETURN_IF_ERROR(WriteFileAtomically(png.string(), picture));
  ISOMATCH_RETURN_IF_ERROR(WriteFileAtomically(
      library.string(), SampleMaterial(png.filename().string())));
  return WriteFileAtomically(path,
                             FormatObj(path, sample.mesh, {&texture, nullptr}));
}

absl::Status WriteTexturedGlb(const std::string& path, const Sample& sample,
                              SamplePattern pattern) {
  const MeshTexture texture = SampleTexture(sample, /*library=*/"");
  ISOMATCH_ASSIGN_OR_RETURN(std::string picture,
                            EncodePng(SamplePicture(pattern)));
  return WriteFileAtomically(
      path, FormatGlb(sample.mesh, {&texture, nullptr, {std::move(picture)}}));
}

absl::Status WriteSample(const SampleArguments& arguments,
                         const Sample& sample) {
  const std::string& path = arguments.output;
  if (arguments.texture.empty()) return WriteMesh(path, sample.mesh);
  const SamplePattern pattern = arguments.texture == "stripes"
                                    ? SamplePattern::kStripes
                                    : SamplePattern::kChecker;
  if (LowerExtension(path) == ".obj") {
    return WriteTexturedObj(path, sample, pattern);
  }
  if (LowerExtension(path) == ".glb") {
    return WriteTexturedGlb(path, sample, pattern);
  }
  const Colors colors = SampleColors(sample, pattern);
  return WriteFileAtomically(path,
                             FormatPly(sample.mesh, ColorColumns(colors)));
}

/// What was written, for machines.
nlohmann::ordered_json Summary(const SampleArguments& arguments,
                               const SampleOptions& options,
                               const TriangleMesh& mesh) {
  using nlohmann::ordered_json;
  return {{"output", arguments.output},
          {"pose", std::string(1, options.pose)},
          {"mesh_seed", options.mesh_seed},
          {"vertices", mesh.num_vertices()},
          {"faces", mesh.num_faces()},
          {"truth", arguments.truth.empty() ? ordered_json()
                                            : ordered_json(arguments.truth)}};
}

absl::Status RunSample(const SampleArguments& arguments,
                       const Terminal& terminal) {
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
  ISOMATCH_RETURN_IF_ERROR(WriteSample(arguments, sample));
  if (!truth.empty()) {
    ISOMATCH_RETURN_IF_ERROR(WriteFileAtomically(arguments.truth, truth));
  }
  return arguments.json
             ? PrintJson(Summary(arguments, options, sample.mesh), terminal)
             : absl::OkStatus();
}

}  // namespace

Command AddSampleCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "sample", "Writes a procedural animal, and the truth about a pair.");
  const auto arguments = std::make_shared<SampleArguments>();
  command->add_option("--pose", arguments->pose, "A, B or C")
      ->type_name("POSE")
      ->capture_default_str();
  command
      ->add_option("--vertices", arguments->vertices,
                   "100 to 5000000, met exactly")
      ->type_name("COUNT")
      ->capture_default_str();
  command
      ->add_option("--mesh-seed", arguments->mesh_seed,
                   "Another seed gives another triangulation")
      ->check(WholeNumber(0, std::numeric_limits<std::uint64_t>::max()))
      ->type_name("SEED")
      ->capture_default_str();
  command
      ->add_option("-o,--output", arguments->output,
                   "Mesh to write, .off, .ply or .glb; .obj with --texture")
      ->type_name(kFile)
      ->required();
  SetChoices(command->add_option("--texture", arguments->texture,
                                 "Pattern on the animal"),
             "PATTERN", {"checker", "stripes"});
  command
      ->add_option("--truth-from", arguments->truth_from,
                   "The mesh that the truth is for")
      ->type_name("POSE:VERTICES[:MESH_SEED]");
  command
      ->add_option("--truth", arguments->truth,
                   "Ground truth to write, from that mesh to this one, .txt")
      ->type_name(kFile);
  command->add_flag("--json", arguments->json,
                    "Print what was written as JSON");
  command->footer(kSampleFooter);
  return {command, [arguments](const Terminal& terminal) {
            return RunSample(*arguments, terminal);
          }};
}

}  // namespace isomatch
