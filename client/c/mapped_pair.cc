#include "client/c/mapped_pair.h"

#include <cmath>
#include <cstddef>
#include <numeric>
#include <string>

#include "absl/strings/str_cat.h"
#include "client/c/arguments.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

constexpr double kWeightTolerance = 1e-3;

absl::Status CheckVertex(const std::string& field, std::size_t entry,
                         VertexIndex vertex, VertexIndex vertices) {
  if (vertex >= kNoVertex && vertex < vertices) return absl::OkStatus();
  return Invalid(absl::StrCat(field, "[", entry, "]"),
                 absl::StrCat(vertex, ", expected a vertex of Y, 0 to ",
                              vertices - 1, ", or -1"));
}

absl::StatusOr<PrecisePoint> PointOf(const isomatch_mapped_pair& pair,
                                     std::size_t x, VertexIndex vertices) {
  PrecisePoint point;
  for (std::size_t corner = 0; corner < 3; ++corner) {
    const std::size_t entry = 3 * x + corner;
    point.vertices[corner] = pair.precise_vertices[entry];
    point.weights[corner] = pair.precise_weights[entry];
    ISOMATCH_RETURN_IF_ERROR(CheckVertex("precise_vertices", entry,
                                         point.vertices[corner], vertices));
    const double weight = point.weights[corner];
    if (!(weight >= -kWeightTolerance && weight <= 1 + kWeightTolerance)) {
      return Invalid(absl::StrCat("precise_weights[", entry, "]"),
                     absl::StrCat(weight, ", expected 0 to 1"));
    }
  }
  const auto& v = point.vertices;
  if (v[0] == kNoVertex || v[1] == kNoVertex || v[2] == kNoVertex) {
    return PrecisePoint();
  }
  const double sum =
      std::accumulate(point.weights.begin(), point.weights.end(), 0.0);
  if (std::abs(sum - 1) > kWeightTolerance) {
    return Invalid(absl::StrCat("precise_weights[", 3 * x, "]"),
                   absl::StrCat("sum ", sum, ", expected 1"));
  }
  return point;
}

}  // namespace

std::vector<PrecisePoint> MappedMeshes::Places() const {
  if (!precise.empty()) return precise;
  std::vector<PrecisePoint> places;
  places.reserve(y_from_x.size());
  for (const VertexIndex image : y_from_x) {
    places.push_back(image == kNoVertex
                         ? PrecisePoint()
                         : PrecisePoint{{image, image, image}, {1, 0, 0}});
  }
  return places;
}

absl::StatusOr<MappedMeshes> MappedMeshesOf(const isomatch_mapped_pair& pair) {
  MappedMeshes own;
  ISOMATCH_ASSIGN_OR_RETURN(own.x, CopyOf(pair.mesh_x, "mesh_x"));
  ISOMATCH_ASSIGN_OR_RETURN(own.y, CopyOf(pair.mesh_y, "mesh_y"));
  if (pair.map == nullptr) return Invalid("map", "NULL, expected a map");
  if ((pair.precise_vertices == nullptr) != (pair.precise_weights == nullptr)) {
    return Invalid("precise_weights", "expected both or none of the two");
  }
  const VertexIndex vertices_y = own.y.num_vertices();
  const auto vertices_x = static_cast<std::size_t>(own.x.num_vertices());
  own.y_from_x.assign(pair.map, pair.map + vertices_x);
  for (std::size_t x = 0; x < vertices_x; ++x) {
    ISOMATCH_RETURN_IF_ERROR(
        CheckVertex("map", x, own.y_from_x[x], vertices_y));
    if (pair.precise_vertices == nullptr) continue;
    ISOMATCH_ASSIGN_OR_RETURN(const PrecisePoint point,
                              PointOf(pair, x, vertices_y));
    own.precise.push_back(point);
  }
  return own;
}

}  // namespace isomatch
