#include "client/files/place_file.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "client/files/input_file.h"
#include "client/files/map_file.h"
#include "client/files/map_parser.h"
#include "client/files/text_file.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

using Words = std::vector<absl::string_view>;

constexpr std::size_t kPreciseColumns = 4;
// Weights are written in single precision; whoever rounds to three digits is
// understood too.
constexpr double kWeightTolerance = 0.002;

constexpr char kBlanks[] = " \t\r,";

// Whether the first line that has numbers has those of a precise place.
bool IsPrecise(absl::string_view text) {
  LineCursor rows = {text};
  return rows.Next() &&
         SplitWords(rows.line, kBlanks).size() == kPreciseColumns;
}

absl::StatusOr<SurfacePoint> ParsePlace(const std::string& path, int line,
                                        const Words& words,
                                        const TriangleMesh& mesh_y) {
  if (words.size() != kPreciseColumns) {
    return LineError(path, line,
                     absl::StrCat("found ", words.size(),
                                  " numbers, expected 4 (FACE W0 W1 W2)"));
  }
  VertexIndex face = 0;
  if (!absl::SimpleAtoi(words[0], &face) || face < kNoVertex ||
      face >= mesh_y.num_faces()) {
    return LineError(
        path, line,
        absl::StrCat("FACE is ", words[0].substr(0, 40), ", expected -1 to ",
                     mesh_y.num_faces() - 1, " (0-based)"));
  }
  SurfacePoint point;
  double sum = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    double& weight = point.weights[static_cast<Eigen::Index>(i)];
    if (!absl::SimpleAtod(words[i + 1], &weight) ||
        !(weight >= -kWeightTolerance) || !(weight <= 1 + kWeightTolerance)) {
      return LineError(path, line,
                       absl::StrCat("W", i, " is ", words[i + 1].substr(0, 40),
                                    ", expected 0 to 1"));
    }
    weight = std::clamp(weight, 0.0, 1.0);
    sum += weight;
  }
  if (face == kNoVertex) return SurfacePoint{};
  if (std::abs(sum - 1) > kWeightTolerance) {
    return LineError(
        path, line,
        absl::StrCat("the sum of the weights is ", sum, ", expected 1"));
  }
  point.face = face;
  point.weights /= sum;
  return point;
}

PrecisePoint ToPrecise(const SurfacePoint& point, const Faces& faces) {
  PrecisePoint precise;
  if (point.face == kNoVertex) return precise;
  for (int i = 0; i < 3; ++i) {
    const auto corner = static_cast<std::size_t>(i);
    precise.vertices[corner] = faces(point.face, i);
    precise.weights[corner] = point.weights[i];
  }
  return precise;
}

absl::StatusOr<PlacesOnY> ParsePlaces(const std::string& path,
                                      absl::string_view text,
                                      std::optional<VertexIndex> vertices_x,
                                      const TriangleMesh& mesh_y) {
  PlacesOnY places;
  places.is_precise = true;
  for (LineCursor rows = {text}; rows.Next();) {
    ISOMATCH_ASSIGN_OR_RETURN(
        const SurfacePoint point,
        ParsePlace(path, rows.number, SplitWords(rows.line, kBlanks), mesh_y));
    places.on_faces.push_back(point);
    places.points.push_back(ToPrecise(point, mesh_y.faces));
  }
  if (!vertices_x ||
      places.points.size() == static_cast<std::size_t>(*vertices_x)) {
    return places;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("'", path, "': ", places.points.size(), " lines, expected ",
                   *vertices_x, ", one for each vertex of X"));
}

}  // namespace

VertexMap PlacesOnY::HeaviestVertices() const {
  VertexMap vertices;
  vertices.reserve(points.size());
  for (const PrecisePoint& point : points) {
    const auto heaviest =
        std::max_element(point.weights.begin(), point.weights.end());
    vertices.push_back(point.vertices[static_cast<std::size_t>(
        heaviest - point.weights.begin())]);
  }
  return vertices;
}

absl::StatusOr<PlacesOnY> ReadPlaces(const std::string& path,
                                     std::optional<VertexIndex> vertices_x,
                                     const TriangleMesh& mesh_y) {
  ISOMATCH_ASSIGN_OR_RETURN(
      const InputFile file,
      ReadInput(path, "a map, or places `FACE W0 W1 W2`"));
  if (MapFormatOf(path, file) == MapFormat::kText && IsPrecise(file.bytes)) {
    return ParsePlaces(path, file.bytes, vertices_x, mesh_y);
  }
  ISOMATCH_ASSIGN_OR_RETURN(
      const VertexMap y_from_x,
      ParseMap(path, file, mesh_y.num_vertices(), vertices_x));
  PlacesOnY places;
  for (const VertexIndex y : y_from_x) {
    places.points.push_back(
        y == kNoVertex ? PrecisePoint{} : PrecisePoint{{y, y, y}, {1, 0, 0}});
  }
  return places;
}

}  // namespace isomatch
