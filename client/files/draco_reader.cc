#include "client/files/draco_reader.h"

#include <cstddef>
#include <string>

#include "absl/status/statusor.h"
#include "core/io/draco_mesh.h"

namespace isomatch {

std::optional<MeshFault> ReadDracoSoup(absl::string_view bytes,
                                       PolygonSoup* soup) {
  const bool has_ids = HasVertexIds(bytes);
  const absl::StatusOr<TriangleMesh> mesh = DecodeDraco(
      bytes, has_ids ? VertexOrder::kIdAttribute : VertexOrder::kDecoded,
      /*vertex_count=*/0);
  if (!mesh.ok()) return MeshFault{"", std::string(mesh.status().message())};
  soup->format = "Draco";
  soup->points.reserve(static_cast<std::size_t>(mesh->num_vertices()));
  for (Eigen::Index v = 0; v < mesh->positions.rows(); ++v) {
    soup->points.push_back(
        {mesh->positions(v, 0), mesh->positions(v, 1), mesh->positions(v, 2)});
  }
  soup->corners.assign(mesh->faces.data(),
                       mesh->faces.data() + mesh->faces.size());
  soup->sizes.assign(static_cast<std::size_t>(mesh->faces.rows()), 3);
  if (!has_ids && RenumbersVertices(bytes)) {
    soup->warnings.push_back(
        "encoded by edgebreaker without a vertex_id attribute: vertices are "
        "numbered as Draco's decoder returns them, not as they were before");
  }
  return std::nullopt;
}

}  // namespace isomatch
