#include "core/mesh/nearest_vertices.h"

#include "core/base/nearest_columns.h"

namespace isomatch {

absl::StatusOr<VertexMap> NearestVertices(const Positions& positions,
                                          const VertexMap& queries,
                                          const VertexMap& points,
                                          const std::stop_token& stop) {
  // Single precision will do for a shape of about unit size.
  const Eigen::RowVector3d center = positions.colwise().mean();
  const double size = (positions.rowwise() - center).cwiseAbs().maxCoeff();
  const auto columns = [&](const VertexMap& vertices) -> PointColumns {
    return ((positions(vertices, Eigen::all).rowwise() - center) / size)
        .transpose()
        .cast<float>();
  };
  return NearestColumns(columns(queries), columns(points), stop);
}

}  // namespace isomatch
