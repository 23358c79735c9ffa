#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "client/files/mesh_file.h"
#include "client/files/vertex_colors.h"
#include "client/picture/image.h"
#include "client/sample/sample_animal.h"

namespace isomatch {

/// A pattern on the sample animal, the same in every pose: its left side is
/// warm, its right side cold.
enum class SamplePattern {
  /// Squares of a sixteenth of the animal's length.
  kChecker,
  /// Bands from nose to tail of the same width.
  kStripes,
};

/// Returns where the faces of a sample lie in the picture of SamplePicture. The
/// left half of the picture is the animal at rest seen from the left, the right
/// half the same from its right side, looked through; each face lies in the
/// half of its side. `library` is the path of the .mtl file.
MeshTexture SampleTexture(const Sample& sample, const std::string& library);

/// Where a point of the animal at rest lies in the half of the left side, or of
/// the right.
Eigen::RowVector2d SampleCoordinates(const Eigen::RowVector3d& rest,
                                     bool is_left);

/// The pattern, 1024 x 512.
Image SamplePicture(SamplePattern pattern);

/// The pattern's color at each vertex.
Colors SampleColors(const Sample& sample, SamplePattern pattern);

/// Text of the .mtl file that names the picture `png`.
std::string SampleMaterial(const std::string& png);

}  // namespace isomatch
