#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include <Eigen/Core>

#include "client/c/arguments.h"
#include "client/c/mapped_pair.h"
#include "client/files/mesh_file.h"
#include "client/transfer/texture_carrier.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

/// Rows of u and v, six numbers a face, as a texture: corners with the same
/// coordinates share them, so that what is between them is no seam.
MeshTexture TextureOf(const double* uv, Eigen::Index faces) {
  MeshTexture texture;
  texture.corners.setConstant(faces, 3, -1);
  std::map<std::pair<double, double>, VertexIndex> known;
  for (Eigen::Index corner = 0; corner < 3 * faces; ++corner) {
    const std::pair place(uv[2 * corner], uv[2 * corner + 1]);
    if (!std::isfinite(place.first) || !std::isfinite(place.second)) continue;
    const auto number = static_cast<VertexIndex>(known.size());
    texture.corners(corner / 3, corner % 3) =
        known.try_emplace(place, number).first->second;
  }
  texture.coordinates.resize(static_cast<Eigen::Index>(known.size()), 2);
  for (const auto& [place, number] : known) {
    texture.coordinates.row(number) << place.first, place.second;
  }
  texture.material_of_face.assign(static_cast<std::size_t>(faces), -1);
  return texture;
}

void WriteCorners(const MeshTexture& texture, double* uv) {
  for (Eigen::Index corner = 0; corner < texture.corners.size(); ++corner) {
    const VertexIndex row = texture.corners(corner / 3, corner % 3);
    for (int axis = 0; axis < 2; ++axis) {
      uv[2 * corner + axis] = row < 0 ? std::numeric_limits<double>::quiet_NaN()
                                      : texture.coordinates(row, axis);
    }
  }
}

}  // namespace
}  // namespace isomatch

isomatch_status isomatch_carry_texture(const isomatch_mapped_pair* pair,
                                       const double* uv_y, double* uv_x,
                                       isomatch_error** error) {
  return isomatch::Guarded(error, [&]() -> absl::Status {
    ISOMATCH_ASSIGN_OR_RETURN(const isomatch::MappedMeshes meshes,
                              isomatch::MappedMeshesOf(*pair));
    if (uv_y == nullptr) {
      return isomatch::Invalid("uv_y", "NULL, expected texture coordinates");
    }
    ISOMATCH_ASSIGN_OR_RETURN(
        const isomatch::CarriedTexture carried,
        isomatch::CarryTexture(meshes.x, meshes.y,
                               isomatch::TextureOf(uv_y, meshes.y.num_faces()),
                               meshes.Places(), {}));
    isomatch::WriteCorners(carried.texture, uv_x);
    return absl::OkStatus();
  });
}
