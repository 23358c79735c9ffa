#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/cli/command_support.h"
#include "client/cli/commands.h"
#include "client/cli/option_support.h"
#include "client/files/mesh_input.h"
#include "client/files/place_file.h"
#include "client/job/map_errors.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

constexpr char kEvaluateFooter[] = R"(
The error of a vertex is the geodesic distance on Y between the vertex, or with
a --precise file the place, that MAP names and the true one (Princeton protocol), as a fraction of Y's geodesic
diameter and of the square root of its area.

GT names vertices, so a --precise file measures about half an edge even where it
is right, and a map that hits the vertex none.

GT has lines `x y`, or `x y y_mirrored` for shapes with a left-right symmetry,
or one bare y for each vertex of X, or is a map in a .npy or .json file. With
y_mirrored, the error against the mirrored truth is given too: a map that is
good there only swaps left and right.

-1 in MAP or GT stands for no counterpart. Where there is one, the IoU of the
overlap is told, too: the vertices of X that MAP matches and that have a
counterpart by GT, by those of which either is true. Vertices of X that GT does
not name count in neither. With --mesh-x vertices weigh by their area.

Examples:
  isomatch evaluate Y.off map.txt truth.txt
  isomatch evaluate Y.off places.txt truth.txt
  isomatch evaluate Y.off map.npy truth.txt --json
  isomatch evaluate Y.off map.txt truth.txt --mesh-x part.off)";

struct EvaluateArguments {
  std::string y;
  std::string map;
  std::string truth;
  std::string mesh_x;
  std::string weld;
  bool json = false;
};

struct Measured {
  MapErrors errors;
  bool is_precise = false;
  /// The IoU is by area, not by number of vertices.
  bool by_area = false;
};

absl::StatusOr<Measured> Measure(const EvaluateArguments& arguments,
                                 const std::stop_token& stop) {
  ISOMATCH_ASSIGN_OR_RETURN(const LoadedMesh y,
                            LoadMeshFile(arguments.y, "Y", arguments.weld));
  std::optional<LoadedMesh> x;
  std::optional<VertexIndex> vertices_x;
  if (!arguments.mesh_x.empty()) {
    ISOMATCH_ASSIGN_OR_RETURN(
        x, LoadMeshFile(arguments.mesh_x, "--mesh-x", arguments.weld));
    vertices_x = x->mesh.num_vertices();
  }
  ISOMATCH_ASSIGN_OR_RETURN(
      const PlacesOnY places,
      ReadPlaces(arguments.map, vertices_x, y.WithFileFaces()));
  const VertexMap vertices = places.HeaviestVertices();
  Measured measured;
  measured.is_precise = places.is_precise;
  measured.by_area = x.has_value();
  ISOMATCH_ASSIGN_OR_RETURN(
      measured.errors,
      MeasureAgainstTruth(
          {vertices, places.on_faces, &y.file_faces(), x ? &x->mesh : nullptr},
          y.mesh, arguments.truth, stop));
  return measured;
}

nlohmann::ordered_json ErrorJson(const GeodesicError& error) {
  nlohmann::ordered_json within = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < kErrorThresholds.size(); ++i) {
    within.push_back(
        {{"threshold", kErrorThresholds[i]}, {"fraction", error.within[i]}});
  }
  return {{"mean_over_diameter", error.mean_over_diameter},
          {"mean_over_sqrt_area", error.mean_over_sqrt_area},
          {"max_over_diameter", error.max_over_diameter},
          {"within", std::move(within)},
          {"evaluated", error.evaluated},
          {"unmatched", error.unmatched}};
}

std::string FormatJson(const Measured& measured) {
  const auto& [errors, is_precise, by_area] = measured;
  nlohmann::ordered_json json = {{"diameter", errors.direct.diameter},
                                 {"sqrt_area", errors.direct.sqrt_area},
                                 {"precise", is_precise},
                                 {"iou", errors.iou.value_or(1)},
                                 {"iou_weights", by_area ? "area" : "vertices"},
                                 {"direct", ErrorJson(errors.direct)}};
  if (errors.mirrored) json["mirrored"] = ErrorJson(*errors.mirrored);
  constexpr int kIndent = 2;
  return json.dump(kIndent) + "\n";
}

std::string FormatText(const std::string& name, const GeodesicError& error) {
  std::string text = absl::StrFormat(
      "%s: %d vertices compared, %d without a match\n"
      "  mean error / diam(Y)       %.5f\n"
      "  mean error / sqrt(area(Y)) %.5f\n"
      "  max error / diam(Y)        %.5f\n",
      name, error.evaluated, error.unmatched, error.mean_over_diameter,
      error.mean_over_sqrt_area, error.max_over_diameter);
  for (std::size_t i = 0; i < kErrorThresholds.size(); ++i) {
    absl::StrAppendFormat(&text, "  within %.2f diam(Y)        %6.2f %%\n",
                          kErrorThresholds[i], 100 * error.within[i]);
  }
  return text;
}

std::string FormatIou(double iou, bool by_area) {
  return absl::StrFormat("IoU of the overlap, by %s %.5f\n",
                         by_area ? "area of X" : "number of vertices", iou);
}

absl::Status RunEvaluate(const EvaluateArguments& arguments,
                         const Terminal& terminal) {
  ISOMATCH_ASSIGN_OR_RETURN(const Measured measured,
                            Measure(arguments, terminal.stop));
  if (arguments.json) return Print(FormatJson(measured), terminal);
  const MapErrors& errors = measured.errors;
  std::string text = FormatText("direct", errors.direct);
  if (errors.mirrored) text += FormatText("mirrored", *errors.mirrored);
  if (errors.iou) text += FormatIou(*errors.iou, measured.by_area);
  return Print(text, terminal);
}

}  // namespace

Command AddEvaluateCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "evaluate", "Measures the error of a map against a ground truth.");
  const auto arguments = std::make_shared<EvaluateArguments>();
  command->add_option("Y", arguments->y, "Mesh that the map leads to")
      ->required()
      ->type_name(kFile);
  command
      ->add_option("MAP", arguments->map,
                   "Map (.txt, .npy, .json), or --precise file")
      ->required()
      ->type_name(kFile);
  command->add_option("GT", arguments->truth, "Ground truth")
      ->required()
      ->type_name(kFile);
  command
      ->add_option("--mesh-x", arguments->mesh_x,
                   "Mesh that MAP is of, whose areas weigh the IoU")
      ->type_name(kFile);
  AddWeldOption(command, &arguments->weld);
  command->add_flag("--json", arguments->json, "Print JSON instead of text");
  command->footer(kEvaluateFooter);
  return {command, [arguments](const Terminal& terminal) {
            return RunEvaluate(*arguments, terminal);
          }};
}

}  // namespace isomatch
