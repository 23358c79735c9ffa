#include "core/mesh/triangle_mesh.h"

#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/mesh/mesh_geometry.h"

namespace isomatch {
namespace {

absl::Status CheckPositions(const Positions& positions,
                            const std::string& field) {
  for (Eigen::Index v = 0; v < positions.rows(); ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      const double value = positions(v, axis);
      if (std::isfinite(value)) continue;
      return absl::InvalidArgumentError(
          absl::StrCat(field, ": coordinate ", axis, " of vertex ", v, " is ",
                       value, ", expected a finite number"));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckFaces(const TriangleMesh& mesh, const std::string& field) {
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    for (int corner = 0; corner < 3; ++corner) {
      const VertexIndex v = mesh.faces(f, corner);
      if (v >= 0 && v < mesh.num_vertices()) continue;
      return absl::InvalidArgumentError(
          absl::StrCat(field, ": face ", f, " names vertex ", v,
                       ", expected 0 to ", mesh.num_vertices() - 1));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status ValidateMesh(const TriangleMesh& mesh, const std::string& field) {
  if (mesh.num_vertices() < 3 || mesh.num_faces() < 1) {
    return absl::InvalidArgumentError(
        absl::StrCat(field, ": ", mesh.num_vertices(), " vertices and ",
                     mesh.num_faces(), " faces, expected at least one face"));
  }
  ISOMATCH_RETURN_IF_ERROR(CheckPositions(mesh.positions, field));
  ISOMATCH_RETURN_IF_ERROR(CheckFaces(mesh, field));
  const double area = SurfaceArea(mesh);
  if (!(area > std::numeric_limits<double>::min()) || !std::isfinite(area)) {
    return absl::InvalidArgumentError(
        absl::StrCat(field, ": surface area is ", area,
                     ", expected a positive, finite area"));
  }
  return absl::OkStatus();
}

}  // namespace isomatch
