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

Examples:
  isomatch evaluate Y.off map.txt truth.txt
  isomatch evaluate Y.off places.txt truth.txt
  isomatch evaluate Y.off map.npy truth.txt --json)";

struct EvaluateArguments {
  std::string y;
  std::string map;
  std::string truth;
  std::string weld;
  bool json = false;
};

struct Measured {
  MapErrors errors;
  bool is_precise = false;
};

absl::StatusOr<Measured> Measure(const EvaluateArguments& arguments,
                                 const std::stop_token& stop) {
  ISOMATCH_ASSIGN_OR_RETURN(const LoadedMesh y,
                            LoadMeshFile(arguments.y, "Y", arguments.weld));
  ISOMATCH_ASSIGN_OR_RETURN(
      const PlacesOnY places,
      ReadPlaces(arguments.map, /*vertices_x=*/std::nullopt,
                 y.WithFileFaces()));
  const VertexMap vertices = places.HeaviestVertices();
  Measured measured;
  measured.is_precise = places.is_precise;
  ISOMATCH_ASSIGN_OR_RETURN(
      measured.errors,
      MeasureAgainstTruth({vertices, places.on_faces, &y.file_faces}, y.mesh,
                          arguments.truth, stop));
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
  const auto& [errors, is_precise] = measured;
  nlohmann::ordered_json json = {{"diameter", errors.direct.diameter},
                                 {"sqrt_area", errors.direct.sqrt_area},
                                 {"precise", is_precise},
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

absl::Status RunEvaluate(const EvaluateArguments& arguments,
                         const Terminal& terminal) {
  ISOMATCH_ASSIGN_OR_RETURN(const Measured measured,
                            Measure(arguments, terminal.stop));
  if (arguments.json) return Print(FormatJson(measured), terminal);
  const MapErrors& errors = measured.errors;
  std::string text = FormatText("direct", errors.direct);
  if (errors.mirrored) text += FormatText("mirrored", *errors.mirrored);
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
  AddWeldOption(command, &arguments->weld);
  command->add_flag("--json", arguments->json, "Print JSON instead of text");
  command->footer(kEvaluateFooter);
  return {command, [arguments](const Terminal& terminal) {
            return RunEvaluate(*arguments, terminal);
          }};
}

}  // namespace isomatch
