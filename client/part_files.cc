#include "client/part_files.h"

#include <vector>

#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "client/face_finder.h"
#include "client/text_file.h"

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
