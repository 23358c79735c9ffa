#pragma once

#include <cstdint>
#include <string>

#include <Eigen/Core>

#include "absl/status/status.h"
#include "core/base/vertex_index.h"

namespace isomatch {

/// n x 3, one vertex a row, in the file's own unit.
using Positions = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// m x 3, the three vertices of each face, counter-clockwise seen from outside.
using Faces = Eigen::Matrix<VertexIndex, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// A triangle mesh as a value. Nothing is promised of it before ValidateMesh.
struct TriangleMesh {
  Positions positions;
  Faces faces;

  VertexIndex num_vertices() const {
    return static_cast<VertexIndex>(positions.rows());
  }
  VertexIndex num_faces() const {
    return static_cast<VertexIndex>(faces.rows());
  }
};

/// Returns OK when the mesh can be worked on: it has a face of positive area,
/// every coordinate is finite, every face index names a vertex, there are at
/// most 2^31 / 6 faces, and the core's numbers hold its proportions: no vertex
/// on a face lies farther from the middle (of each axis, the median) than 10^7
/// median edges, 10^6 times the square root of the area, or 10^70 units.
/// Otherwise INVALID_ARGUMENT, whose message begins with `field` and says which
/// vertex or face, what was found and what was expected. Does not depend on
/// where the mesh lies. Time O(n + m).
absl::Status ValidateMesh(const TriangleMesh& mesh, const std::string& field);

}  // namespace isomatch
