#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "client/cli/command_support.h"
#include "client/cli/commands.h"
#include "client/cli/option_support.h"
#include "client/files/glb_file.h"
#include "client/files/landmark_points.h"
#include "client/files/map_file.h"
#include "client/files/material_pictures.h"
#include "client/files/mesh_file.h"
#include "client/files/mesh_input.h"
#include "client/files/named_vertices.h"
#include "client/files/obj_file.h"
#include "client/files/place_file.h"
#include "client/files/ply_file.h"
#include "client/files/point_file.h"
#include "client/files/text_file.h"
#include "client/files/vertex_colors.h"
#include "client/transfer/texture_carrier.h"
#include "client/transfer/transfer.h"
#include "core/base/status_macros.h"
#include "core/mesh/mesh_geometry.h"
#include "core/mesh/surface_point.h"

namespace isomatch {
namespace {

using Json = nlohmann::ordered_json;

constexpr char kTransferFooter[] = R"(
MAP is a map from X to Y as `match` writes it (.txt, .npy, .json), or a file of
`match --precise`, with which colors and texture coordinates are interpolated
between the vertices of Y.

Without --labels and --landmarks, OUT is X in the looks of Y's file:
  OUT.obj  texture coordinates (vt of an OBJ file, with its materials) and
           vertex colors, whichever Y has. All corners of a face lie on one
           side of Y's seams; the .mtl file is named, not copied.
  OUT.glb  the same with the materials' pictures (map_Kd of .mtl, or those of
           Y's glTF file), PNG or JPEG, in one file; the first vertices are X's
  OUT.ply  vertex colors of Y (.ply, .obj, .off, .glb, .gltf)
With --labels, OUT (.txt or .npy) has for each vertex of X the label of the
nearest vertex of Y; labels are never averaged. With --landmarks, whose lines
are `VERTEX [NAME]` of Y, OUT.txt has such lines of X: the vertex whose place on
Y is nearest along the surface; of several at the same distance the one nearest
to their middle, then the first. Landmarks may be points, too (.mrk.json, .fcsv,
.csv), and OUT.mrk.json, .fcsv or .csv has points on X with the same labels:
with --precise places between its vertices.

Examples:
  isomatch match scan.off template.obj -o map.txt --precise places.txt
  isomatch transfer scan.off template.obj places.txt -o textured.obj
  isomatch transfer scan.off template.obj places.txt -o textured.glb
  isomatch transfer scan.off template.obj map.txt -o colored.ply
  isomatch transfer scan.off template.obj map.txt --labels parts.txt \
                    -o scan_parts.txt
  isomatch transfer scan.off template.obj places.txt \
                    --landmarks template_points.txt -o scan_points.txt
  isomatch transfer scan.off template.obj places.txt \
                    --landmarks template.mrk.json -o scan.mrk.json)";

// Farther from every vertex of X, as a fraction of sqrt(area of Y), a landmark
// was not really found.
constexpr double kFarLandmark = 0.05;

struct TransferArguments {
  std::string x;
  std::string y;
  std::string map;
  std::string output;
  std::string labels;
  std::string landmarks;
  std::string weld;
  std::int64_t missing = -1;
  bool json = false;
};

// What every kind of transfer works on.
struct Inputs {
  TriangleMesh mesh_x;
  /// As its file has it, before --weld.
  TriangleMesh mesh_y;
  /// Y after --weld.
  TriangleMesh welded_y;
  /// What the file of Y says of them, or why it cannot be read.
  absl::StatusOr<std::optional<Colors>> colors_y;
  absl::StatusOr<std::optional<MeshTexture>> texture_y;
  PlacesOnY places;
  int unmatched = 0;
};

// What a transfer brought.
struct Outcome {
  std::string bytes;
  // Lines for people, and fields for machines.
  std::string text;
  Json json = Json::object();
  std::vector<std::string> warnings;
};

absl::Status CheckArguments(const TransferArguments& arguments) {
  if (!arguments.labels.empty() && !arguments.landmarks.empty()) {
    return absl::InvalidArgumentError(
        "--labels and --landmarks are given both, expected one of them: each "
        "has an OUT of its own");
  }
  const std::vector<const char*> expected =
      !arguments.labels.empty() ? std::vector{".txt", ".npy"}
      : !arguments.landmarks.empty()
          ? std::vector{".txt", ".json", ".fcsv", ".csv"}
          : std::vector{".obj", ".glb", ".ply"};
  const std::string extension = LowerExtension(arguments.output);
  if (std::find(expected.begin(), expected.end(), extension) ==
      expected.end()) {
    return absl::InvalidArgumentError(absl::StrCat(
        "--output '", arguments.output, "': the extension is '", extension,
        "', expected ", absl::StrJoin(expected, " or "), " for ",
        !arguments.labels.empty()      ? "labels"
        : !arguments.landmarks.empty() ? "landmarks"
                                       : "a mesh"));
  }
  ISOMATCH_RETURN_IF_ERROR(CheckOutputFile(arguments.output));
  return CheckNotInput("--output", arguments.output,
                       {arguments.x, arguments.y, arguments.map,
                        arguments.labels, arguments.landmarks});
}

absl::StatusOr<Inputs> ReadInputs(const TransferArguments& arguments,
                                  const Terminal& terminal) {
  Inputs inputs;
  std::vector<std::string> warnings;
  ISOMATCH_ASSIGN_OR_RETURN(
      LoadedPair meshes,
      LoadMeshes(arguments.x, arguments.y, arguments.weld, &warnings));
  auto& [x, y] = meshes;
  Warn(warnings, terminal);
  inputs.mesh_x = x.WithFileFaces();
  inputs.mesh_y = y.WithFileFaces();
  inputs.welded_y = std::move(y.mesh);
  inputs.colors_y = std::move(y.colors);
  inputs.texture_y = std::move(y.texture);
  ISOMATCH_ASSIGN_OR_RETURN(
      inputs.places,
      ReadPlaces(arguments.map, inputs.mesh_x.num_vertices(), inputs.mesh_y));
  inputs.unmatched = CountUnmatched(inputs.places.points);
  return inputs;
}

// Says how many vertices of X have nothing, and what stands for it.
void CountVertices(const Inputs& inputs, const std::string& what,
                   const std::string& substitute, Outcome* outcome) {
  const VertexIndex vertices = inputs.mesh_x.num_vertices();
  absl::StrAppend(&outcome->text, what, ": ", vertices - inputs.unmatched,
                  " of ", vertices, " vertices\n");
  if (inputs.unmatched > 0) {
    outcome->warnings.push_back(
        absl::StrCat(inputs.unmatched, " of ", vertices,
                     " vertices of X have no place on Y: ", substitute));
  }
}

void CountTexture(const CarriedTexture& carried, Outcome* outcome) {
  const auto faces = static_cast<VertexIndex>(carried.texture.corners.rows());
  absl::StrAppend(&outcome->text,
                  "texture coordinates: ", faces - carried.faces_without,
                  " of ", faces, " faces, ", carried.faces_on_seams,
                  " of them across a seam of Y\n");
  outcome->json["texture"] = {{"faces", faces},
                              {"without", carried.faces_without},
                              {"on_seams", carried.faces_on_seams}};
  if (carried.faces_without > 0) {
    outcome->warnings.push_back(
        absl::StrCat(carried.faces_without, " of ", faces,
                     " faces of X have no texture coordinates: a corner has no "
                     "place on Y, or lies where Y has none"));
  }
}

absl::Status NothingToCarry(const TransferArguments& arguments,
                            bool has_texture) {
  if (has_texture) {
    return absl::InvalidArgumentError(absl::StrCat(
        "--output '", arguments.output, "': Y has texture coordinates only, '",
        arguments.y, "' no vertex colors; expected an .obj or .glb file"));
  }
  return absl::InvalidArgumentError(absl::StrCat(
      "Y: '", arguments.y,
      "' has neither texture coordinates (.obj with vt, .glb) nor vertex "
      "colors (.ply, .obj, .off, .glb), expected some, or --labels or "
      "--landmarks"));
}

// The bytes of OUT.
std::string FormatLooks(const std::string& path, const TriangleMesh& mesh_x,
                        const MeshTexture* texture, const Colors* colors,
                        Outcome* outcome) {
  const std::string extension = LowerExtension(path);
  if (extension == ".ply") return FormatPly(mesh_x, ColorColumns(*colors));
  if (extension == ".glb") {
    std::vector<std::string> pictures;
    if (texture != nullptr) {
      pictures = MaterialPictures(*texture, &outcome->warnings);
    }
    return FormatGlb(mesh_x, {texture, colors, std::move(pictures)});
  }
  if (texture != nullptr && !texture->images.empty()) {
    outcome->warnings.push_back(
        "the pictures of Y's glTF file are left out, expected a .glb file for "
        "them");
  }
  return FormatObj(path, mesh_x, {texture, colors});
}

absl::StatusOr<Outcome> CarryLooks(const TransferArguments& arguments,
                                   const Inputs& inputs,
                                   const Terminal& terminal) {
  ISOMATCH_RETURN_IF_ERROR(inputs.colors_y.status());
  ISOMATCH_RETURN_IF_ERROR(inputs.texture_y.status());
  const std::optional<Colors>& colors_y = *inputs.colors_y;
  const std::optional<MeshTexture>& texture_y = *inputs.texture_y;
  const bool is_ply = LowerExtension(arguments.output) == ".ply";
  if (!colors_y && (!texture_y || is_ply)) {
    return NothingToCarry(arguments, texture_y.has_value());
  }
  Outcome outcome;
  std::optional<CarriedTexture> texture;
  if (texture_y && !is_ply) {
    ISOMATCH_ASSIGN_OR_RETURN(
        texture, CarryTexture(inputs.mesh_x, inputs.mesh_y, *texture_y,
                              inputs.places.points, terminal.stop));
    CountTexture(*texture, &outcome);
  } else if (texture_y) {
    outcome.warnings.push_back(
        "texture coordinates of Y are left out, expected an .obj or .glb file "
        "for them");
  }
  std::optional<Colors> colors;
  if (colors_y) {
    colors = CarryColors(*colors_y, inputs.places.points);
    CountVertices(inputs, "vertex colors", "they are gray", &outcome);
  }
  outcome.bytes = FormatLooks(arguments.output, inputs.mesh_x,
                              texture ? &texture->texture : nullptr,
                              colors ? &*colors : nullptr, &outcome);
  outcome.json["colors"] = colors.has_value();
  return outcome;
}

absl::StatusOr<Outcome> CarryLabelFile(const TransferArguments& arguments,
                                       const Inputs& inputs) {
  ISOMATCH_ASSIGN_OR_RETURN(
      const std::vector<std::int64_t> labels,
      ReadLabels(arguments.labels, inputs.mesh_y.num_vertices()));
  Outcome outcome;
  outcome.bytes = FormatLabels(
      arguments.output,
      CarryLabels(labels, inputs.places.points, arguments.missing));
  CountVertices(inputs, "labels",
                absl::StrCat("their label is ", arguments.missing), &outcome);
  outcome.json["missing"] = arguments.missing;
  return outcome;
}

// Says where each landmark went, and warns of those that are far off.
void TellLandmarks(absl::Span<const NamedVertex> landmarks,
                   absl::Span<const CarriedLandmark> carried, double unit,
                   Outcome* outcome) {
  Json all = Json::array();
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    const auto& [y, name] = landmarks[i];
    const auto& [x, distance] = carried[i];
    all.push_back({{"name", name},
                   {"y", y},
                   {"x", x},
                   {"distance", x == kNoVertex ? Json() : Json(distance)}});
    absl::StrAppend(&outcome->text, y, " -> ", x, name.empty() ? "" : " ", name,
                    "\n");
    if (x != kNoVertex && distance <= kFarLandmark * unit) continue;
    outcome->warnings.push_back(
        x == kNoVertex
            ? absl::StrCat("landmark ", y, " ", name,
                           " is not carried: no vertex of X lies on that part "
                           "of Y")
            : absl::StrFormat("landmark %d %s: the nearest vertex of X is %.1f "
                              "%% of sqrt(area) away, expected less than "
                              "%.0f; X may have no counterpart of it",
                              y, name, 100 * distance / unit,
                              100 * kFarLandmark));
  }
  outcome->json["landmarks"] = std::move(all);
}

// Landmarks of Y: vertices, and where they are in space.
struct LandmarksOfY {
  std::vector<NamedVertex> vertices;
  std::vector<Eigen::RowVector3d> positions;
  std::string space;
};

absl::StatusOr<LandmarksOfY> ReadLandmarksOfY(const std::string& path,
                                              const TriangleMesh& mesh_y,
                                              Outcome* outcome) {
  LandmarksOfY landmarks;
  if (IsPointFile(path)) {
    ISOMATCH_ASSIGN_OR_RETURN(SnappedPoints snapped,
                              ReadSnappedPoints(path, mesh_y, "Y"));
    for (const SnappedPoint& point : snapped.points) {
      landmarks.vertices.push_back({point.vertex, point.label});
      landmarks.positions.push_back(PositionOf(mesh_y, point.place));
    }
    landmarks.space = snapped.space;
    outcome->text = snapped.summary + "\n";
    outcome->warnings = std::move(snapped.warnings);
    return landmarks;
  }
  ISOMATCH_ASSIGN_OR_RETURN(landmarks.vertices,
                            ReadNamedVertices(path, mesh_y));
  for (const NamedVertex& landmark : landmarks.vertices) {
    landmarks.positions.push_back(mesh_y.positions.row(landmark.vertex));
  }
  return landmarks;
}

// The bytes of OUT: vertices of X, or places on it.
std::string FormatLandmarks(const std::string& path, const Inputs& inputs,
                            const LandmarksOfY& landmarks,
                            absl::Span<const CarriedLandmark> carried) {
  std::vector<NamedVertex> vertices;
  std::vector<LandmarkPoint> points;
  for (std::size_t i = 0; i < carried.size(); ++i) {
    const VertexIndex x = carried[i].x;
    if (x == kNoVertex) continue;
    const std::string& name = landmarks.vertices[i].name;
    vertices.push_back({x, name});
    points.push_back({inputs.places.is_precise
                          ? PointOnX(landmarks.positions[i], x, inputs.mesh_x,
                                     inputs.mesh_y, inputs.places.points)
                          : Eigen::RowVector3d(inputs.mesh_x.positions.row(x)),
                      name});
  }
  return IsPointFile(path) ? FormatPoints(path, landmarks.space, points)
                           : FormatNamedVertices(vertices);
}

absl::StatusOr<Outcome> CarryLandmarkFile(const TransferArguments& arguments,
                                          const Inputs& inputs,
                                          const Terminal& terminal) {
  Outcome outcome;
  ISOMATCH_ASSIGN_OR_RETURN(
      const LandmarksOfY landmarks,
      ReadLandmarksOfY(arguments.landmarks, inputs.mesh_y, &outcome));
  VertexMap vertices;
  for (const NamedVertex& landmark : landmarks.vertices) {
    vertices.push_back(landmark.vertex);
  }
  ISOMATCH_ASSIGN_OR_RETURN(
      const std::vector<CarriedLandmark> carried,
      CarryLandmarks(vertices, inputs.mesh_x, inputs.welded_y,
                     inputs.places.points, terminal.stop));
  TellLandmarks(landmarks.vertices, carried,
                std::sqrt(SurfaceArea(inputs.welded_y)), &outcome);
  outcome.bytes = FormatLandmarks(arguments.output, inputs, landmarks, carried);
  return outcome;
}

absl::Status RunTransfer(const TransferArguments& arguments,
                         const Terminal& terminal) {
  ISOMATCH_RETURN_IF_ERROR(CheckArguments(arguments));
  ISOMATCH_ASSIGN_OR_RETURN(const Inputs inputs,
                            ReadInputs(arguments, terminal));
  absl::StatusOr<Outcome> outcome =
      !arguments.labels.empty() ? CarryLabelFile(arguments, inputs)
      : !arguments.landmarks.empty()
          ? CarryLandmarkFile(arguments, inputs, terminal)
          : CarryLooks(arguments, inputs, terminal);
  if (!outcome.ok()) return outcome.status();
  ISOMATCH_RETURN_IF_ERROR(
      WriteFileAtomically(arguments.output, outcome->bytes));
  Warn(outcome->warnings, terminal);
  if (!arguments.json) return Print(outcome->text, terminal);
  Json json = {{"output", arguments.output},
               {"vertices", inputs.mesh_x.num_vertices()},
               {"unmatched", inputs.unmatched},
               {"precise", inputs.places.is_precise}};
  json.update(outcome->json);
  json["warnings"] = outcome->warnings;
  return PrintJson(json, terminal);
}

}  // namespace

Command AddTransferCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "transfer",
      "Carries texture, colors, labels or landmarks from Y to X along a map.");
  const auto arguments = std::make_shared<TransferArguments>();
  command->add_option("X", arguments->x, "Mesh to carry to")->required();
  command->add_option("Y", arguments->y, "Mesh to carry from")->required();
  command
      ->add_option("MAP", arguments->map,
                   "Map from X to Y (.txt, .npy, .json), or --precise file")
      ->required();
  command
      ->add_option("-o,--output", arguments->output,
                   "OUT: .obj, .glb or .ply; labels .txt or .npy; landmarks "
                   ".txt, .mrk.json, .fcsv or .csv")
      ->required();
  CLI::Option* const labels = command->add_option(
      "--labels", arguments->labels,
      "Labels of Y's vertices, one whole number a line or .npy");
  command->add_option("--landmarks", arguments->landmarks,
                      "Landmarks of Y, lines `VERTEX [NAME]`, 0-based, or "
                      "points: .mrk.json, .fcsv, .csv");
  command
      ->add_option("--missing", arguments->missing,
                   "Label of vertices that have no place on Y")
      ->type_name("LABEL")
      ->capture_default_str()
      ->needs(labels);
  for (const char* name :
       {"X", "Y", "MAP", "--output", "--labels", "--landmarks"}) {
    command->get_option(name)->type_name(kFile);
  }
  AddWeldOption(command, &arguments->weld);
  command->add_flag("--json", arguments->json,
                    "Print JSON about what was carried instead of text");
  command->footer(kTransferFooter);
  return {command, [arguments](const Terminal& terminal) {
            return RunTransfer(*arguments, terminal);
          }};
}

}  // namespace isomatch
