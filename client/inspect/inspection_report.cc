#include "client/inspect/inspection_report.h"

#include <algorithm>
#include <cstddef>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace isomatch {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kMegabyte = 1e6;
// Components that text lists one by one.
constexpr std::size_t kListed = 5;

// `count` things, or nothing to say.
std::string Counted(std::int64_t count, const std::string& one,
                    const std::string& several) {
  if (count == 0) return "";
  return absl::StrCat(", ", count, " ", count == 1 ? one : several);
}

std::string OrNone(const std::string& list) {
  constexpr std::size_t kSeparator = 2;  // ", "
  return list.empty() ? "none" : list.substr(kSeparator);
}

std::string Damage(const MeshInspection& mesh) {
  return OrNone(absl::StrCat(
      Counted(mesh.isolated_vertices, "vertex on no face",
              "vertices on no face"),
      Counted(mesh.coincident_vertices, "vertex doubled along a seam",
              "vertices doubled along seams"),
      Counted(mesh.degenerate_faces, "degenerate face", "degenerate faces"),
      Counted(mesh.repeated_faces, "repeated face", "repeated faces"),
      Counted(mesh.flat_faces, "face of no area", "faces of no area"),
      Counted(mesh.nonmanifold_edges, "non-manifold edge",
              "non-manifold edges"),
      Counted(mesh.nonmanifold_vertices, "non-manifold vertex",
              "non-manifold vertices")));
}

std::string Orientation(const MeshInspection& mesh) {
  switch (mesh.turn) {
    case FaceTurn::kOutward:
      return "consistent, outward";
    case FaceTurn::kInward:
      return "consistent, inward: all faces will be turned";
    case FaceTurn::kMixed:
      return absl::StrCat("consistent, ", mesh.turned_faces,
                          " faces of inward components will be turned");
    case FaceTurn::kInconsistent:
      return absl::StrCat("inconsistent at ", mesh.disagreeing_edges,
                          " edges, ", mesh.turned_faces,
                          " faces will be turned");
    case FaceTurn::kNone:
      return "none: the faces cannot be made to agree";
    case FaceTurn::kFlat:
      return "consistent, without an outside";
  }
  return "";  // not reached
}

std::string Describe(const ComponentTopology& component) {
  const auto genus = component.Genus();
  const std::string rims =
      component.boundary_loops == 0
          ? "closed"
          : absl::StrCat("open, ", component.boundary_loops,
                         component.boundary_loops == 1 ? " rim" : " rims");
  return absl::StrFormat(
      "%d vertices, %d faces, area %.4g, %s, %s, Euler characteristic %d",
      component.vertices, component.faces, component.area, rims,
      genus ? absl::StrCat("genus ", *genus) : "no genus",
      component.euler_characteristic);
}

void AppendLine(const char* name, const std::string& value, std::string* text) {
  absl::StrAppendFormat(text, "  %-12s %s\n", name, value);
}

void AppendComponents(const MeshInspection& mesh, std::string* text) {
  const std::size_t listed = std::min(mesh.components.size(), kListed);
  for (std::size_t i = 0; i < listed; ++i) {
    AppendLine(absl::StrCat("component ", i + 1).c_str(),
               Describe(mesh.components[i]), text);
  }
  if (listed == mesh.components.size()) return;
  double area = 0;
  for (std::size_t i = listed; i < mesh.components.size(); ++i) {
    area += mesh.components[i].area;
  }
  AppendLine("",
             absl::StrFormat("and %d more, area %.4g in all",
                             mesh.components.size() - listed, area),
             text);
}

std::string Cost(const MatchCost& cost) {
  return absl::StrFormat(
      "about %.2g s on two cores, at most %.0f MB, with a mesh like it; %.2f "
      "MB to send",
      cost.seconds, static_cast<double>(cost.memory_bytes) / kMegabyte,
      static_cast<double>(cost.encoded_bytes) / kMegabyte);
}

Json VectorJson(const Eigen::RowVector3d& vector) {
  return {vector[0], vector[1], vector[2]};
}

Json ComponentJson(const ComponentTopology& component) {
  const auto genus = component.Genus();
  return {{"vertices", component.vertices},
          {"faces", component.faces},
          {"area", component.area},
          {"boundary_loops", component.boundary_loops},
          {"euler_characteristic", component.euler_characteristic},
          {"genus", genus ? Json(*genus) : Json()},
          {"manifold", component.is_manifold},
          {"oriented", component.is_oriented}};
}

}  // namespace

std::string FormatInspection(const InspectionReport& report) {
  const MeshInspection& mesh = report.mesh;
  std::string text =
      absl::StrCat(report.path, ": ", report.format, ", ", mesh.vertices,
                   " vertices, ", mesh.faces, " faces\n");
  AppendComponents(mesh, &text);
  AppendLine("orientation", Orientation(mesh), &text);
  const Eigen::RowVector3d size = mesh.box_high - mesh.box_low;
  AppendLine(
      "scale",
      absl::StrFormat("bounding box %.4g x %.4g x %.4g, area %.4g, mean "
                      "edge %.4g",
                      size[0], size[1], size[2], mesh.area, mesh.mean_edge),
      &text);
  AppendLine("damage", Damage(mesh), &text);
  for (const std::string& line : report.reading) {
    AppendLine("reading", line, &text);
  }
  for (const std::string& line : mesh.cleaning) {
    AppendLine("cleaning", line, &text);
  }
  AppendLine("match", Cost(report.cost), &text);
  AppendLine(
      "server",
      report.cost.refusals.empty() ? "would accept it" : "would refuse it",
      &text);
  for (const std::string& line : report.cost.refusals) {
    AppendLine("refusal", line, &text);
  }
  for (const std::string& line : mesh.warnings) {
    AppendLine("warning", line, &text);
  }
  return text;
}

Json InspectionJson(const InspectionReport& report) {
  const MeshInspection& mesh = report.mesh;
  Json components = Json::array();
  for (const ComponentTopology& component : mesh.components) {
    components.push_back(ComponentJson(component));
  }
  return {{"path", report.path},
          {"format", report.format},
          {"vertices", mesh.vertices},
          {"faces", mesh.faces},
          {"components", std::move(components)},
          {"large_components", mesh.large_components},
          {"orientation", FaceTurnName(mesh.turn)},
          {"disagreeing_edges", mesh.disagreeing_edges},
          {"turned_faces", mesh.turned_faces},
          {"box_low", VectorJson(mesh.box_low)},
          {"box_high", VectorJson(mesh.box_high)},
          {"area", mesh.area},
          {"mean_edge", mesh.mean_edge},
          {"isolated_vertices", mesh.isolated_vertices},
          {"coincident_vertices", mesh.coincident_vertices},
          {"degenerate_faces", mesh.degenerate_faces},
          {"repeated_faces", mesh.repeated_faces},
          {"flat_faces", mesh.flat_faces},
          {"boundary_edges", mesh.boundary_edges},
          {"nonmanifold_edges", mesh.nonmanifold_edges},
          {"nonmanifold_vertices", mesh.nonmanifold_vertices},
          {"reading", report.reading},
          {"cleaning", mesh.cleaning},
          {"about_seconds", report.cost.seconds},
          {"memory_estimate_bytes", report.cost.memory_bytes},
          {"encoded_bytes", report.cost.encoded_bytes},
          {"accepted", report.cost.refusals.empty()},
          {"refusals", report.cost.refusals},
          {"warnings", mesh.warnings}};
}

}  // namespace isomatch
