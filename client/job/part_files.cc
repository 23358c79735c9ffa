#include "client/job/part_files.h"

#include <cstddef>
#include <vector>

#include <nlohmann/json.hpp>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "client/files/face_finder.h"
#include "client/files/input_file.h"
#include "client/files/text_file.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

using Json = nlohmann::ordered_json;

Json ToJson(const Eigen::VectorXd& vector) {
  return std::vector<double>(vector.begin(), vector.end());
}

}  // namespace

std::string FormatPreciseMap(absl::Span<const PrecisePoint> points,
                             const TriangleMesh& mesh_y) {
  const FaceFinder faces(mesh_y);
  std::string text;
  for (const PrecisePoint& point : points) {
    const SurfacePoint found = faces.Find(point);
    absl::StrAppend(&text, found.face);
    for (const double weight : found.weights) {
      text += ' ';
      AppendNumber(static_cast<float>(weight), &text);
    }
    text += '\n';
  }
  return text;
}

std::string FormatConfidence(absl::Span<const float> confidence) {
  std::string text;
  for (const float value : confidence) {
    AppendNumber(value, &text);
    text += '\n';
  }
  return text;
}

absl::StatusOr<std::vector<float>> ReadConfidence(const std::string& path,
                                                  std::int64_t vertices_x) {
  ISOMATCH_ASSIGN_OR_RETURN(
      const InputFile file,
      ReadInput(path, "confidence: one number from 0 to 1 a line"));
  std::vector<float> confidence;
  for (LineCursor rows = {file.bytes}; rows.Next();) {
    float value = 0;
    // The comparison is false for NaN.
    if (!absl::SimpleAtof(rows.line, &value) || !(0 <= value && value <= 1)) {
      return LineError(path, rows.number,
                       absl::StrCat("found ", Quoted(rows.line),
                                    ", expected one number from 0 to 1"));
    }
    confidence.push_back(value);
  }
  if (static_cast<std::int64_t>(confidence.size()) == vertices_x) {
    return confidence;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("'", path, "': ", confidence.size(), " numbers, expected ",
                   vertices_x, ", one for each vertex of X"));
}

std::string FormatMask(absl::Span<const char> matched_y) {
  std::string text;
  text.reserve(2 * matched_y.size());
  for (const char is_matched : matched_y) text += is_matched ? "1\n" : "0\n";
  return text;
}

absl::StatusOr<std::vector<std::uint8_t>> ReadMaskY(const std::string& path,
                                                    std::int64_t vertices_y) {
  ISOMATCH_ASSIGN_OR_RETURN(const InputFile file,
                            ReadInput(path, "a mask: 0 or 1 a line"));
  std::vector<std::uint8_t> mask;
  for (LineCursor rows = {file.bytes}; rows.Next();) {
    if (rows.line != "0" && rows.line != "1") {
      return LineError(
          path, rows.number,
          absl::StrCat("found ", Quoted(rows.line), ", expected 0 or 1"));
    }
    mask.push_back(rows.line == "1" ? 1 : 0);
  }
  if (static_cast<std::int64_t>(mask.size()) == vertices_y) return mask;
  return absl::InvalidArgumentError(
      absl::StrCat("'", path, "': ", mask.size(), " lines, expected ",
                   vertices_y, ", one for each vertex of Y"));
}

std::string FormatFunctionalMap(const FunctionalMap& map) {
  Json rows = Json::array();
  for (Eigen::Index row = 0; row < map.fmap_x_from_y.rows(); ++row) {
    rows.push_back(ToJson(map.fmap_x_from_y.row(row).transpose()));
  }
  const Json json = {{"eigenvalues_x", ToJson(map.eigenvalues_x)},
                     {"eigenvalues_y", ToJson(map.eigenvalues_y)},
                     {"matrix", std::move(rows)}};
  return json.dump() + "\n";
}

}  // namespace isomatch
