#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "client/cli/command_support.h"
#include "client/cli/commands.h"
#include "client/cli/option_support.h"
#include "client/files/map_file.h"
#include "client/files/mesh_file.h"
#include "client/files/mesh_input.h"
#include "client/files/place_file.h"
#include "client/files/text_file.h"
#include "client/files/vertex_colors.h"
#include "client/job/map_errors.h"
#include "client/job/part_files.h"
#include "client/picture/image.h"
#include "client/viewer/figures.h"
#include "client/viewer/layers.h"
#include "client/viewer/page.h"
#include "client/viewer/picture.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

namespace fs = std::filesystem;

constexpr char kViewFooter[] = R"(
The page is one HTML file that asks nothing of the network: both shapes in 3D
with linked cameras. Y is colored by place, and each vertex of X has the color
of its image, so that a good map looks the same on both sides and a mirrored or
torn one does not. With a --precise file the images lie between the vertices of
Y, and the colors are not jagged. Other layers are the distortion, the confidence of
`isomatch match --confidence` and the error against a ground truth; pointing at a
vertex shows its partners.

A picture has X on the left and Y on the right. Both may be written at once.

Examples:
  isomatch view X.off Y.off map.txt -o report.html
  isomatch view X.off Y.off map.txt -o report.html --report report.json \
    --confidence confidence.txt --truth truth.txt
  isomatch view X.off Y.off map.txt --png picture.png --pattern checker
  isomatch view X_colored.ply Y.ply map.txt --png transfer.png --file-colors
  isomatch view X.off Y.off map.txt --png error.png --layer error \
    --truth truth.txt --size 2400x1200 --up z)";

constexpr char kColors[] = "colors";

struct ViewArguments {
  std::string x;
  std::string y;
  std::string map;
  std::string page;
  std::string picture;
  std::string size = "1600x800";
  std::string layer = kColors;
  std::string pattern = "plain";
  std::string up;
  std::string confidence;
  std::string truth;
  std::string report;
  std::string title;
  std::string weld;
  bool file_colors = false;
  bool json = false;
};

absl::Status CheckOutputs(const ViewArguments& arguments) {
  if (arguments.page.empty() && arguments.picture.empty()) {
    return absl::InvalidArgumentError(
        "nothing to write, expected --output PAGE.html or --png PICTURE.png");
  }
  ISOMATCH_RETURN_IF_ERROR(
      CheckExtension("--output", arguments.page, {".html", ".htm", ""}));
  ISOMATCH_RETURN_IF_ERROR(
      CheckExtension("--png", arguments.picture, {".png", ""}));
  for (const std::string& path : {arguments.page, arguments.picture}) {
    if (!path.empty()) ISOMATCH_RETURN_IF_ERROR(CheckOutputFile(path));
  }
  std::error_code error;
  if (fs::weakly_canonical(arguments.page, error) !=
      fs::weakly_canonical(arguments.picture, error)) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("--png '", arguments.picture,
                   "': is the file of --output too, expected another"));
}

absl::Status CheckLayer(const ViewArguments& arguments) {
  if (arguments.file_colors &&
      (!arguments.page.empty() || arguments.layer != kColors)) {
    return absl::InvalidArgumentError(
        "--file-colors: is for --png alone, without --output and --layer");
  }
  if (arguments.layer == "confidence" && arguments.confidence.empty()) {
    return absl::InvalidArgumentError(
        "--layer confidence: needs --confidence FILE");
  }
  if (arguments.layer == "error" && arguments.truth.empty()) {
    return absl::InvalidArgumentError("--layer error: needs --truth FILE");
  }
  return absl::OkStatus();
}

absl::StatusOr<PictureOptions> ParsePictureOptions(
    const ViewArguments& arguments) {
  PictureOptions options = {.layer = arguments.layer};
  const std::vector<std::string> sides = absl::StrSplit(arguments.size, 'x');
  const auto fits = [](int side) {
    return PictureOptions::kMinSide <= side && side <= PictureOptions::kMaxSide;
  };
  if (sides.size() != 2 || !absl::SimpleAtoi(sides[0], &options.width) ||
      !absl::SimpleAtoi(sides[1], &options.height) || !fits(options.width) ||
      !fits(options.height)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "--size is '", arguments.size, "', expected WIDTHxHEIGHT of ",
        PictureOptions::kMinSide, " to ", PictureOptions::kMaxSide,
        " pixels each, e.g. 1600x800"));
  }
  if (arguments.pattern == "stripes") options.pattern = Pattern::kStripes;
  if (arguments.pattern == "checker") options.pattern = Pattern::kChecker;
  return options;
}

std::optional<int> UpAxis(const std::string& up) {
  if (up.empty()) return std::nullopt;
  return up[0] - 'x';
}

/// Long work is told to a person who waits.
void Say(const Terminal& terminal, const std::string& what) {
  if (terminal.is_interactive) {
    terminal.err << "isomatch: " << what << std::endl;
  }
}

/// Reads a mesh into `view`, with its warnings.
absl::StatusOr<LoadedMesh> LoadShown(const std::string& path,
                                     const std::string& field,
                                     const std::string& weld, NamedMesh& shown,
                                     PairView& view) {
  ISOMATCH_ASSIGN_OR_RETURN(LoadedMesh loaded, LoadMeshFile(path, field, weld));
  for (const std::string& warning : loaded.warnings) {
    view.warnings.push_back(absl::StrCat(field, ": ", warning));
  }
  shown = {fs::path(path).filename().string(), loaded.WithFileFaces()};
  return loaded;
}

absl::Status AddError(const ViewArguments& arguments, const Terminal& terminal,
                      const MappedPair& pair, const TriangleMesh& welded_y,
                      PairView& view) {
  Say(terminal, absl::StrCat("measuring geodesic errors of ",
                             pair.mesh_x.num_vertices(), " vertices"));
  ISOMATCH_ASSIGN_OR_RETURN(
      const MapErrors errors,
      MeasureAgainstTruth({pair.y_from_x, pair.precise, &pair.mesh_y.faces},
                          welded_y, arguments.truth, terminal.stop));
  view.layers.push_back(ErrorLayer(pair, errors.direct));
  view.figures.push_back(ErrorFigures(errors.direct, errors.mirrored));
  return absl::OkStatus();
}

absl::Status AddReport(const std::string& path, PairView& view) {
  ISOMATCH_ASSIGN_OR_RETURN(
      const std::string bytes,
      ReadFile(path, "a report that `isomatch match --report` wrote"));
  ISOMATCH_ASSIGN_OR_RETURN(ReportFigures report,
                            ParseReport(path, bytes, view.x.mesh.num_vertices(),
                                        view.y.mesh.num_vertices()));
  view.figures.insert(view.figures.end(), report.tables.begin(),
                      report.tables.end());
  // They repeat the meshes' warnings.
  view.warnings = std::move(report.warnings);
  return absl::OkStatus();
}

absl::StatusOr<std::vector<Rgb>> FileColors(const std::string& path,
                                            const std::string& field,
                                            const LoadedMesh& loaded) {
  ISOMATCH_RETURN_IF_ERROR(loaded.colors.status());
  const std::optional<Colors>& colors = *loaded.colors;
  if (!colors) {
    return absl::InvalidArgumentError(
        absl::StrCat(field, ": '", path,
                     "' has no vertex colors, which --file-colors shows"));
  }
  std::vector<Rgb> bytes;
  for (Eigen::Index v = 0; v < colors->rows(); ++v) {
    bytes.push_back(ColorBytes(colors->row(v)));
  }
  return bytes;
}

/// Reads and measures all that is shown.
absl::StatusOr<PairView> Load(const ViewArguments& arguments,
                              const Terminal& terminal) {
  PairView view;
  ISOMATCH_ASSIGN_OR_RETURN(
      const LoadedMesh x,
      LoadShown(arguments.x, "X", arguments.weld, view.x, view));
  ISOMATCH_ASSIGN_OR_RETURN(
      const LoadedMesh y,
      LoadShown(arguments.y, "Y", arguments.weld, view.y, view));
  const TriangleMesh& mesh_x = view.x.mesh;
  const TriangleMesh& mesh_y = view.y.mesh;
  ISOMATCH_ASSIGN_OR_RETURN(
      PlacesOnY places,
      ReadPlaces(arguments.map, mesh_x.num_vertices(), mesh_y));
  view.y_from_x = places.HeaviestVertices();
  view.precise = std::move(places.on_faces);
  view.title = arguments.title.empty()
                   ? absl::StrCat(view.x.name, " \u2192 ", view.y.name)
                   : arguments.title;
  view.colors_y = PositionRgb(mesh_y.positions);
  if (arguments.file_colors) {
    ISOMATCH_ASSIGN_OR_RETURN(view.colors_x, FileColors(arguments.x, "X", x));
    ISOMATCH_ASSIGN_OR_RETURN(view.colors_y, FileColors(arguments.y, "Y", y));
  }
  view.rotation = ViewRotation(mesh_x, mesh_y, UpAxis(arguments.up));
  if (!arguments.report.empty()) {
    ISOMATCH_RETURN_IF_ERROR(AddReport(arguments.report, view));
  }
  const MappedPair pair = {mesh_x, mesh_y, view.y_from_x, view.precise};
  view.layers.push_back(DistortionLayer(pair));
  if (!arguments.confidence.empty()) {
    ISOMATCH_ASSIGN_OR_RETURN(
        std::vector<float> confidence,
        ReadConfidence(arguments.confidence, mesh_x.num_vertices()));
    view.layers.push_back(ConfidenceLayer(pair, std::move(confidence)));
  }
  if (!arguments.truth.empty()) {
    ISOMATCH_RETURN_IF_ERROR(AddError(arguments, terminal, pair, y.mesh, view));
  }
  view.figures.insert(view.figures.begin(), MapFigures(view));
  return view;
}

/// What was written and what it shows, for machines.
nlohmann::ordered_json Summary(const PairView& view,
                               const ViewArguments& arguments) {
  using nlohmann::ordered_json;
  const auto path = [](const std::string& written) {
    return written.empty() ? ordered_json() : ordered_json(written);
  };
  ordered_json layers = ordered_json::array();
  for (const ScalarLayer& layer : view.layers) {
    layers.push_back(
        {{"id", layer.id}, {"low", layer.low}, {"high", layer.high}});
  }
  ordered_json figures = ordered_json::object();
  for (const FigureTable& table : view.figures) {
    for (const auto& [name, value] : table.rows) {
      figures[table.title][name] = value;
    }
  }
  return {{"page", path(arguments.page)}, {"picture", path(arguments.picture)},
          {"layer", arguments.layer},     {"layers", layers},
          {"figures", figures},           {"warnings", view.warnings}};
}

/// A picture has no numbers: they are told here.
absl::Status TellScale(const PairView& view, const ViewArguments& arguments,
                       const Terminal& terminal) {
  const ScalarLayer* layer = FindLayer(view, arguments.layer);
  if (layer == nullptr) return absl::OkStatus();
  return Print(
      absl::StrFormat("%s: %s, scale from %.4g to %.4g\n", arguments.picture,
                      layer->id, layer->low, layer->high),
      terminal);
}

absl::Status WritePage(const PairView& view, const ViewArguments& arguments) {
  if (arguments.page.empty()) return absl::OkStatus();
  ISOMATCH_ASSIGN_OR_RETURN(
      const std::string page,
      FormatPage(view, {arguments.layer, arguments.pattern}));
  return WriteFileAtomically(arguments.page, page);
}

absl::Status WritePicture(const PairView& view, const PictureOptions& options,
                          const ViewArguments& arguments) {
  if (arguments.picture.empty()) return absl::OkStatus();
  ISOMATCH_ASSIGN_OR_RETURN(const std::string png,
                            EncodePng(DrawPair(view, options)));
  return WriteFileAtomically(arguments.picture, png);
}

absl::Status RunView(const ViewArguments& arguments, const Terminal& terminal) {
  ISOMATCH_RETURN_IF_ERROR(CheckOutputs(arguments));
  ISOMATCH_RETURN_IF_ERROR(CheckLayer(arguments));
  ISOMATCH_ASSIGN_OR_RETURN(const PictureOptions options,
                            ParsePictureOptions(arguments));
  ISOMATCH_ASSIGN_OR_RETURN(const PairView view, Load(arguments, terminal));
  ISOMATCH_RETURN_IF_ERROR(WritePage(view, arguments));
  ISOMATCH_RETURN_IF_ERROR(WritePicture(view, options, arguments));
  if (arguments.json) return PrintJson(Summary(view, arguments), terminal);
  return arguments.picture.empty() ? absl::OkStatus()
                                   : TellScale(view, arguments, terminal);
}

void AddAppearance(CLI::App& command, ViewArguments& arguments) {
  SetChoices(command.add_option("--layer", arguments.layer,
                                "What the colors show, in a page at first"),
             "LAYER", {kColors, "confidence", "error", "distortion"})
      ->capture_default_str();
  SetChoices(command.add_option("--pattern", arguments.pattern,
                                "What is drawn on Y and carried to X"),
             "PATTERN", {"plain", "stripes", "checker"})
      ->capture_default_str();
  command.add_flag("--file-colors", arguments.file_colors,
                   "In the picture: the vertex colors that the files of X and "
                   "Y have, e.g. after `isomatch transfer`");
  SetChoices(command.add_option("--up", arguments.up,
                                "Axis of the files that points upwards; by "
                                "default y, or z for shapes that are flattest "
                                "along y"),
             "AXIS", {"x", "y", "z"});
  command
      .add_option("--size", arguments.size, "Size of the picture, in pixels")
      ->type_name("WIDTHxHEIGHT")
      ->capture_default_str();
  command
      .add_option("--title", arguments.title,
                  "Title of the page, by default the names of the meshes")
      ->type_name("TEXT");
  SetGroup(
      &command, "Appearance",
      {"--layer", "--pattern", "--file-colors", "--up", "--size", "--title"});
}

void AddFiles(CLI::App& command, ViewArguments& arguments) {
  command.add_option("X", arguments.x, "Mesh that the map is of")->required();
  command.add_option("Y", arguments.y, "Mesh that the map leads to")
      ->required();
  command
      .add_option("MAP", arguments.map,
                  "Map (.txt, .npy, .json), or --precise file")
      ->required();
  command.add_option("-o,--output", arguments.page, "Page to write, .html");
  command.add_option("--png", arguments.picture, "Picture to write, .png");
  SetGroup(&command, kFilesGroup, {"--output", "--png"});
  command.add_option("--confidence", arguments.confidence,
                     "Confidence as `match --confidence` writes it");
  command.add_option("--truth", arguments.truth,
                     "Ground truth, as `evaluate` reads it");
  command.add_option("--report", arguments.report,
                     "Report as `match --report` writes it");
  for (const char* name : {"X", "Y", "MAP", "--output", "--png", "--confidence",
                           "--truth", "--report"}) {
    command.get_option(name)->type_name(kFile);
  }
}

}  // namespace

Command AddViewCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "view", "Shows a map: as a page with both shapes in 3D, or a picture.");
  const auto arguments = std::make_shared<ViewArguments>();
  AddFiles(*command, *arguments);
  AddAppearance(*command, *arguments);
  AddWeldOption(command, &arguments->weld);
  command->add_flag("--json", arguments->json,
                    "Print what was written, and the figures of the page, as "
                    "JSON");
  command->footer(kViewFooter);
  return {command, [arguments](const Terminal& terminal) {
            return RunView(*arguments, terminal);
          }};
}

}  // namespace isomatch
