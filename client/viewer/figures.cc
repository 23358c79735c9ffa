#include "client/viewer/figures.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <utility>

#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

using Json = nlohmann::ordered_json;

std::string Seconds(double seconds) {
  return absl::StrFormat("%.2f s", seconds);
}
std::string Megabytes(double bytes) {
  return absl::StrFormat("%.0f MB", bytes / 1e6);
}
std::string Plain(double number) { return absl::StrFormat("%.4g", number); }
std::string Percent(double fraction) {
  return absl::StrFormat("%.2f %%", 100 * fraction);
}

/// A number of the report and how it is shown.
struct Field {
  const char* pointer;  // RFC 6901
  const char* label;
  std::string (*format)(double);
};

constexpr Field kQuality[] = {
    {"/symmetry_confidence", "symmetry confidence (0 to 1)", Plain},
    {"/quality/mean_confidence", "mean confidence (0 to 1)", Plain},
    {"/quality/geodesic_distortion", "geodesic distortion / sqrt(area)", Plain},
    {"/quality/area_distortion", "area distortion, mean |ln|", Plain},
    {"/quality/coverage", "coverage of Y's area", Percent},
    {"/embedding_error", "embedding error", Plain},
    {"/orientation_score", "orientation (-1 to 1)", Plain},
    {"/unmatched", "vertices of X without a counterpart", Plain},
};

constexpr Field kMemory[] = {
    {"/peak_resident_bytes", "peak memory of the process", Megabytes},
    {"/memory_estimate_bytes", "memory reserved", Megabytes},
};

absl::Status FieldError(const std::string& path, absl::string_view field,
                        const Json& found, absl::string_view expected) {
  return absl::InvalidArgumentError(absl::StrCat(
      "'", path, "': ", field, " is ",
      found.dump(-1, ' ', true, Json::error_handler_t::replace).substr(0, 40),
      ", expected ", expected));
}

/// The dotted name of a pointer: "quality.coverage".
std::string Dotted(absl::string_view pointer) {
  std::string name(pointer.substr(1));
  std::replace(name.begin(), name.end(), '/', '.');
  return name;
}

absl::Status AppendNumber(const std::string& path, const Json& report,
                          const Field& field, FigureTable& table) {
  const Json::json_pointer pointer(field.pointer);
  if (!report.contains(pointer)) return absl::OkStatus();
  const Json& value = report[pointer];
  if (!value.is_number()) {
    return FieldError(path, Dotted(field.pointer), value, "a number");
  }
  table.rows.emplace_back(field.label, field.format(value.get<double>()));
  return absl::OkStatus();
}

absl::Status AppendText(const std::string& path, const Json& report,
                        const char* field, FigureTable& table) {
  if (!report.contains(field)) return absl::OkStatus();
  if (!report[field].is_string()) {
    return FieldError(path, field, report[field], "a text");
  }
  table.rows.emplace_back(field, report[field].get<std::string>());
  return absl::OkStatus();
}

absl::Status AppendStages(const std::string& path, const Json& report,
                          FigureTable& table) {
  if (!report.contains("seconds")) return absl::OkStatus();
  if (!report["seconds"].is_object()) {
    return FieldError(path, "seconds", report["seconds"], "an object");
  }
  for (const auto& [stage, seconds] : report["seconds"].items()) {
    if (!seconds.is_number()) {
      return FieldError(path, absl::StrCat("seconds.", stage), seconds,
                        "a number");
    }
    table.rows.emplace_back(stage, Seconds(seconds.get<double>()));
  }
  return absl::OkStatus();
}

/// Reports before there were verdicts have none.
absl::Status AppendVerdict(const std::string& path, const Json& report,
                           FigureTable& table) {
  for (const auto& [pointer, label] :
       {std::pair("/verdict/level", "verdict"),
        std::pair("/verdict/reason", "because"),
        std::pair("/verdict/advice", "what to do")}) {
    const Json::json_pointer field(pointer);
    if (!report.contains(field)) continue;
    if (!report[field].is_string()) {
      return FieldError(path, Dotted(pointer), report[field], "a text");
    }
    const auto text = report[field].get<std::string>();
    if (!text.empty()) table.rows.emplace_back(label, text);
  }
  return absl::OkStatus();
}

absl::StatusOr<FigureTable> QualityTable(const std::string& path,
                                         const Json& report) {
  FigureTable table = {"Quality", {}};
  ISOMATCH_RETURN_IF_ERROR(AppendVerdict(path, report, table));
  for (const Field& field : kQuality) {
    ISOMATCH_RETURN_IF_ERROR(AppendNumber(path, report, field, table));
  }
  if (report.contains("alternatives")) {
    if (!report["alternatives"].is_array()) {
      return FieldError(path, "alternatives", report["alternatives"],
                        "an array");
    }
    table.rows.emplace_back("maps that were not chosen",
                            absl::StrCat(report["alternatives"].size()));
  }
  return table;
}

absl::StatusOr<FigureTable> RunTable(const std::string& path,
                                     const Json& report) {
  FigureTable table = {"Run", {}};
  ISOMATCH_RETURN_IF_ERROR(AppendText(path, report, "profile", table));
  ISOMATCH_RETURN_IF_ERROR(AppendStages(path, report, table));
  ISOMATCH_RETURN_IF_ERROR(AppendNumber(
      path, report, {"/total_seconds", "total time", Seconds}, table));
  for (const Field& field : kMemory) {
    ISOMATCH_RETURN_IF_ERROR(AppendNumber(path, report, field, table));
  }
  return table;
}

absl::StatusOr<std::vector<std::string>> Warnings(const std::string& path,
                                                  const Json& report) {
  std::vector<std::string> warnings;
  if (!report.contains("warnings")) return warnings;
  if (!report["warnings"].is_array()) {
    return FieldError(path, "warnings", report["warnings"], "an array");
  }
  for (const Json& warning : report["warnings"]) {
    if (!warning.is_string()) {
      return FieldError(path, "warnings", warning, "texts");
    }
    warnings.push_back(warning.get<std::string>());
  }
  return warnings;
}

absl::Status CheckVertices(const std::string& path, const Json& report,
                           const std::string& mesh, VertexIndex vertices) {
  const Json::json_pointer pointer("/" + mesh + "/vertices");
  if (!report.contains(pointer) || report[pointer] == vertices) {
    return absl::OkStatus();
  }
  return FieldError(path, mesh + ".vertices", report[pointer],
                    absl::StrCat(vertices, ", as the mesh has"));
}

absl::StatusOr<Json> ParseObject(const std::string& path,
                                 absl::string_view bytes) {
  Json report;
  try {  // the parser tells where a mistake is by an exception only
    report = Json::parse(bytes.begin(), bytes.end());
  } catch (const Json::parse_error& error) {
    const auto line =
        1 + std::count(bytes.begin(),
                       bytes.begin() + std::min(error.byte, bytes.size()),
                       '\n');
    return absl::InvalidArgumentError(
        absl::StrCat("'", path, "', line ", line,
                     ": not JSON, expected a report of `isomatch match`"));
  }
  if (report.is_object()) return report;
  return absl::InvalidArgumentError(absl::StrCat(
      "'", path, "': found ", report.type_name(),
      ", expected an object, as the report of `isomatch match` is"));
}

/// Mean of f(value) over the values that are there.
double MeanOf(const std::vector<float>& values,
              const std::function<double(double)>& f) {
  double sum = 0;
  int count = 0;
  for (const float value : values) {
    if (std::isnan(value)) continue;
    sum += f(value);
    ++count;
  }
  return count > 0 ? sum / count : 0;
}

}  // namespace

absl::StatusOr<ReportFigures> ParseReport(const std::string& path,
                                          absl::string_view bytes,
                                          VertexIndex vertices_x,
                                          VertexIndex vertices_y) {
  ISOMATCH_ASSIGN_OR_RETURN(const Json report, ParseObject(path, bytes));
  ISOMATCH_RETURN_IF_ERROR(CheckVertices(path, report, "mesh_x", vertices_x));
  ISOMATCH_RETURN_IF_ERROR(CheckVertices(path, report, "mesh_y", vertices_y));
  ReportFigures figures;
  ISOMATCH_ASSIGN_OR_RETURN(FigureTable quality, QualityTable(path, report));
  ISOMATCH_ASSIGN_OR_RETURN(FigureTable run, RunTable(path, report));
  for (FigureTable* table : {&quality, &run}) {
    if (!table->rows.empty()) figures.tables.push_back(std::move(*table));
  }
  ISOMATCH_ASSIGN_OR_RETURN(figures.warnings, Warnings(path, report));
  return figures;
}

FigureTable MapFigures(const PairView& view) {
  std::vector<bool> is_image(view.y.mesh.num_vertices());
  std::int64_t matched = 0;
  for (const VertexIndex y : view.y_from_x) {
    if (y == kNoVertex) continue;
    ++matched;
    is_image[y] = true;
  }
  const auto reached = std::count(is_image.begin(), is_image.end(), true);
  FigureTable table = {"Map",
                       {{"vertices of X with an image",
                         absl::StrCat(matched, " of ", view.y_from_x.size())},
                        {"vertices of Y that are images",
                         absl::StrCat(reached, " of ", is_image.size())}}};
  if (!view.matched_y.empty()) {
    const auto have =
        std::count_if(view.matched_y.begin(), view.matched_y.end(),
                      [](std::uint8_t has) { return has != 0; });
    table.rows.emplace_back("vertices of Y with a counterpart",
                            absl::StrCat(have, " of ", view.matched_y.size()));
  }
  if (const ScalarLayer* layer = FindLayer(view, "confidence")) {
    table.rows.emplace_back(
        "mean confidence",
        Plain(MeanOf(layer->on_x, [](double value) { return value; })));
  }
  if (const ScalarLayer* layer = FindLayer(view, "distortion")) {
    table.rows.emplace_back("distortion, mean over vertices of |ln|",
                            Plain(MeanOf(layer->on_x, [](double value) {
                              return std::abs(value);
                            })));
  }
  return table;
}

FigureTable ErrorFigures(const GeodesicError& error,
                         const std::optional<GeodesicError>& mirrored,
                         std::optional<double> iou) {
  FigureTable table = {"Error against the truth",
                       {{"vertices compared", absl::StrCat(error.evaluated)},
                        {"without a match", absl::StrCat(error.unmatched)},
                        {"mean / diameter of Y",
                         absl::StrFormat("%.5f", error.mean_over_diameter)},
                        {"largest / diameter of Y",
                         absl::StrFormat("%.5f", error.max_over_diameter)}}};
  for (std::size_t i = 0; i < kErrorThresholds.size(); ++i) {
    table.rows.emplace_back(absl::StrFormat("within %.2f", kErrorThresholds[i]),
                            Percent(error.within[i]));
  }
  if (mirrored) {
    table.rows.emplace_back(
        "mean against the mirrored truth",
        absl::StrFormat("%.5f", mirrored->mean_over_diameter));
  }
  if (iou) {
    table.rows.emplace_back("IoU of the overlap, by area of X",
                            absl::StrFormat("%.5f", *iou));
  }
  return table;
}

}  // namespace isomatch
