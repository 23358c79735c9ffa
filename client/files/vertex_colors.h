#pragma once

#include <vector>

#include <Eigen/Core>

#include "client/files/mesh_file.h"
#include "client/files/ply_file.h"
#include "client/picture/colors.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// What stands for a vertex without a color: kGray.
inline const Eigen::RowVector3d kNoColor =
    Eigen::RowVector3d::Constant(kGray[0] / 255.0);

/// Returns colors that tell places, and left from right, apart: those of
/// `isomatch view` (client/picture/colors.h).
Colors PositionColors(const TriangleMesh& mesh);

/// A color as bytes, rounded.
Rgb ColorBytes(const Eigen::RowVector3d& color);

/// Columns red, green and blue of a PLY file. They refer to `colors`.
std::vector<PlyColumn> ColorColumns(const Colors& colors);

}  // namespace isomatch
