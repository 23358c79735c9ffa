#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "client/files/ply_file.h"
#include "client/picture/colors.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// n x 3: red, green and blue of each vertex, in [0, 1].
using Colors = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// What stands for a vertex without a color: kGray.
inline const Eigen::RowVector3d kNoColor =
    Eigen::RowVector3d::Constant(kGray[0] / 255.0);

/// Returns colors that tell places, and left from right, apart: those of
/// `isomatch view` (client/picture/colors.h).
Colors PositionColors(const Positions& positions);

/// Returns the colors that a mesh file has for its vertices: red, green, blue
/// of a PLY file's vertices; `v x y z r g b` of OBJ; numbers after the
/// coordinates in OFF (or COFF). Bytes, 16-bit numbers or fractions, as the
/// file has them. None when it has no colors, and for STL.
///
/// REQUIRES: ReadMesh(path) gave a mesh of `vertices` vertices.
/// INVALID_ARGUMENT: some vertices have a color and others not, or a color is
/// not a number; the message names file and line or vertex.
absl::StatusOr<std::optional<Colors>> ReadVertexColors(const std::string& path,
                                                       VertexIndex vertices);

/// The same as bytes, rounded.
Rgb ColorBytes(const Eigen::RowVector3d& color);

/// Columns red, green and blue of a PLY file. They refer to `colors`.
std::vector<PlyColumn> ColorColumns(const Colors& colors);

}  // namespace isomatch
