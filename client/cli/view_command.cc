#include <filesystem>
#include <memory>
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
#include "client/cli/page_opener.h"
#include "client/cli/view_folder.h"
#include "client/cli/view_pair.h"
#include "client/files/text_file.h"
#include "client/picture/image.h"
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
torn one does not. Gray: no counterpart (-1 in MAP, 0 in --mask-y). With a --precise file the images lie between the vertices of
Y, and the colors are not jagged. Other layers are the distortion, the confidence of
`isomatch match --confidence` and the error against a ground truth; pointing at a
vertex shows its partners.

In the page one pins pairs of vertices and exports them for `match --landmarks`,
moves X onto Y by a slider, shows edges, and saves what is seen.

With a FOLDER that `isomatch batch` wrote, the page lists its pairs and opens each.
Where they take more than 64 MB, or with --separate-pages, they have pages of their
own in PAGE_pairs beside it.

Without --output and --png the page is written to a temporary folder and opened by
xdg-open where there is a display.

A picture has X on the left and Y on the right. Both may be written at once.

Examples:
  isomatch view X.off Y.off map.txt
  isomatch view maps -o maps.html
  isomatch view X.off Y.off map.txt -o report.html --report report.json \
    --confidence confidence.txt --truth truth.txt
  isomatch view X.off Y.off map.txt --png picture.png --pattern checker
  isomatch view X_colored.ply Y.ply map.txt --png transfer.png --file-colors
  isomatch view X.off Y.off map.txt --png error.png --layer error \
    --truth truth.txt --size 2400x1200 --up z)";

constexpr char kColors[] = "colors";

struct ViewArguments {
  /// x alone, a folder, when y and map are empty.
  ViewFiles files;
  std::string page;
  std::string picture;
  std::string size = "1600x800";
  std::string layer = kColors;
  std::string pattern = "plain";
  bool separate_pages = false;
  bool json = false;
};

bool IsFolder(const ViewArguments& arguments) {
  return arguments.files.y.empty();
}

absl::Status CheckOutputs(const ViewArguments& arguments) {
  ISOMATCH_RETURN_IF_ERROR(
      CheckExtension("--output", arguments.page, {".html", ".htm", ""}));
  ISOMATCH_RETURN_IF_ERROR(
      CheckExtension("--png", arguments.picture, {".png", ""}));
  for (const std::string& path : {arguments.page, arguments.picture}) {
    if (!path.empty()) ISOMATCH_RETURN_IF_ERROR(CheckOutputFile(path));
  }
  if (arguments.page.empty() || arguments.picture.empty()) {
    return absl::OkStatus();
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

/// What X alone stands for, and the options that a folder has not.
absl::Status CheckInputs(const ViewArguments& arguments) {
  const ViewFiles& files = arguments.files;
  if (!IsFolder(arguments)) {
    if (files.map.empty()) {
      return absl::InvalidArgumentError(
          "MAP: is missing, expected X Y MAP or one FOLDER");
    }
    if (!arguments.separate_pages) return absl::OkStatus();
    return absl::InvalidArgumentError(
        "--separate-pages: is for a folder, not for one pair");
  }
  std::error_code error;
  if (!fs::is_directory(files.x, error)) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", files.x,
                     "': is no folder, expected X Y MAP or one FOLDER that "
                     "`isomatch batch` wrote"));
  }
  for (const auto& [option, is_given] :
       {std::pair("--png", !arguments.picture.empty()),
        std::pair("--confidence", !files.confidence.empty()),
        std::pair("--mask-y", !files.mask_y.empty()),
        std::pair("--truth", !files.truth.empty()),
        std::pair("--report", !files.report.empty()),
        std::pair("--file-colors", files.file_colors),
        std::pair("--layer error", arguments.layer == "error")}) {
    if (is_given) {
      return absl::InvalidArgumentError(
          absl::StrCat(option, ": is for one pair, not for a folder"));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckLayer(const ViewArguments& arguments) {
  if (IsFolder(arguments)) return absl::OkStatus();
  if (arguments.files.file_colors &&
      (!arguments.page.empty() || arguments.picture.empty() ||
       arguments.layer != kColors)) {
    return absl::InvalidArgumentError(
        "--file-colors: is for --png alone, without --output and --layer");
  }
  if (arguments.layer == "confidence" && arguments.files.confidence.empty()) {
    return absl::InvalidArgumentError(
        "--layer confidence: needs --confidence FILE");
  }
  if (arguments.layer == "error" && arguments.files.truth.empty()) {
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

/// A picture has no numbers and words: they are told here.
absl::Status TellLegend(const PairView& view, const ViewArguments& arguments,
                        const Terminal& terminal) {
  std::string text;
  if (const ScalarLayer* layer = FindLayer(view, arguments.layer)) {
    text =
        absl::StrFormat("%s: %s, scale from %.4g to %.4g\n", arguments.picture,
                        layer->id, layer->low, layer->high);
  }
  const std::string gray = GrayText(view);
  if (!gray.empty() && !view.colors_x) {
    absl::StrAppend(&text, arguments.picture, ": gray, ", gray, "\n");
  }
  return text.empty() ? absl::OkStatus() : Print(text, terminal);
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

absl::Status ViewPair(const ViewArguments& arguments,
                      const Terminal& terminal) {
  ISOMATCH_ASSIGN_OR_RETURN(const PictureOptions options,
                            ParsePictureOptions(arguments));
  ISOMATCH_ASSIGN_OR_RETURN(const PairView view,
                            LoadPairView(arguments.files, terminal));
  ISOMATCH_RETURN_IF_ERROR(WritePage(view, arguments));
  ISOMATCH_RETURN_IF_ERROR(WritePicture(view, options, arguments));
  if (arguments.json) return PrintJson(Summary(view, arguments), terminal);
  return arguments.picture.empty() ? absl::OkStatus()
                                   : TellLegend(view, arguments, terminal);
}

absl::Status ViewFolder(const ViewArguments& arguments,
                        const Terminal& terminal) {
  const ViewFiles& files = arguments.files;
  FolderViewOptions options = {.folder = files.x,
                               .page = arguments.page,
                               .title = files.title,
                               .up = files.up,
                               .weld = files.weld,
                               .start = {arguments.layer, arguments.pattern}};
  if (arguments.separate_pages) options.embedded_bytes = 0;
  ISOMATCH_ASSIGN_OR_RETURN(const FolderViewOutcome outcome,
                            WriteFolderPage(options, terminal));
  if (!arguments.json) {
    Warn(outcome.failures, terminal);
    return absl::OkStatus();
  }
  const nlohmann::ordered_json pages =
      outcome.pages.empty() ? nlohmann::ordered_json()
                            : nlohmann::ordered_json(outcome.pages);
  return PrintJson({{"page", arguments.page},
                    {"pages", pages},
                    {"pairs", outcome.pairs},
                    {"failures", outcome.failures}},
                   terminal);
}

/// The page's path where the user gives none.
absl::StatusOr<std::string> TemporaryPage(const ViewFiles& files) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::string folder, MakeTemporaryFolder());
  std::error_code error;
  const fs::path x = fs::weakly_canonical(files.x, error);
  const fs::path y = files.y;
  const std::string name =
      files.y.empty()
          ? x.filename().string()
          : absl::StrCat(x.stem().string(), "__", y.stem().string());
  return (fs::path(folder) / (name + ".html")).string();
}

absl::Status RunView(ViewArguments arguments, const Terminal& terminal) {
  ISOMATCH_RETURN_IF_ERROR(CheckInputs(arguments));
  ISOMATCH_RETURN_IF_ERROR(CheckLayer(arguments));
  ISOMATCH_RETURN_IF_ERROR(CheckOutputs(arguments));
  const bool opens = arguments.page.empty() && arguments.picture.empty();
  if (opens) {
    ISOMATCH_ASSIGN_OR_RETURN(arguments.page, TemporaryPage(arguments.files));
  }
  absl::Status shown = IsFolder(arguments) ? ViewFolder(arguments, terminal)
                                           : ViewPair(arguments, terminal);
  if (!opens) return shown;
  if (!shown.ok()) {
    std::error_code error;
    fs::remove_all(fs::path(arguments.page).parent_path(), error);
    return shown;
  }
  return arguments.json ? absl::OkStatus() : OpenPage(arguments.page, terminal);
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
  command.add_flag("--file-colors", arguments.files.file_colors,
                   "In the picture: the vertex colors that the files of X and "
                   "Y have, e.g. after `isomatch transfer`");
  SetChoices(command.add_option("--up", arguments.files.up,
                                "Axis of the files that points upwards; by "
                                "default y, or z for shapes that are flattest "
                                "along y"),
             "AXIS", {"x", "y", "z"});
  command
      .add_option("--size", arguments.size, "Size of the picture, in pixels")
      ->type_name("WIDTHxHEIGHT")
      ->capture_default_str();
  command
      .add_option("--title", arguments.files.title,
                  "Title of the page, by default the names of the meshes")
      ->type_name("TEXT");
  SetGroup(
      &command, "Appearance",
      {"--layer", "--pattern", "--file-colors", "--up", "--size", "--title"});
}

void AddFiles(CLI::App& command, ViewArguments& arguments) {
  command
      .add_option("X", arguments.files.x,
                  "Mesh that the map is of, or a folder of a batch")
      ->required();
  command.add_option("Y", arguments.files.y, "Mesh that the map leads to");
  command.add_option("MAP", arguments.files.map,
                     "Map (.txt, .npy, .json), or --precise file");
  command.add_option("-o,--output", arguments.page,
                     "Page to write, .html; by default a temporary one, "
                     "which is opened");
  command.add_option("--png", arguments.picture, "Picture to write, .png");
  command.add_flag("--separate-pages", arguments.separate_pages,
                   "Of a folder: each pair has a page of its own beside "
                   "PAGE.html");
  SetGroup(&command, kFilesGroup, {"--output", "--png", "--separate-pages"});
  command.add_option("--confidence", arguments.files.confidence,
                     "Confidence as `match --confidence` writes it");
  command.add_option("--mask-y", arguments.files.mask_y,
                     "Which vertices of Y have a counterpart, one 0 or 1 a "
                     "line; the others are gray");
  command.add_option("--truth", arguments.files.truth,
                     "Ground truth, as `evaluate` reads it");
  command.add_option("--report", arguments.files.report,
                     "Report as `match --report` writes it");
  for (const char* name : {"X", "Y", "MAP", "--output", "--png", "--confidence",
                           "--mask-y", "--truth", "--report"}) {
    command.get_option(name)->type_name(kFile);
  }
}

}  // namespace

Command AddViewCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "view",
      "Shows a map, or those of a batch: as a page with both shapes in 3D, "
      "or a picture.");
  const auto arguments = std::make_shared<ViewArguments>();
  AddFiles(*command, *arguments);
  AddAppearance(*command, *arguments);
  AddWeldOption(command, &arguments->files.weld);
  command->add_flag("--json", arguments->json,
                    "Print what was written, and the figures of the page, as "
                    "JSON");
  command->footer(kViewFooter);
  return {command, [arguments](const Terminal& terminal) {
            return RunView(*arguments, terminal);
          }};
}

}  // namespace isomatch
