#pragma once

#include <string>
#include <vector>

#include "client/files/mesh_file.h"

namespace isomatch {

/// Returns the bytes of each material's picture, PNG or JPEG files as they are:
/// of the images of `texture`, else of the first `map_Kd` of the material in
/// its libraries (.mtl). "" where there is none; why a picture that is named
/// cannot be had is appended to `warnings`.
std::vector<std::string> MaterialPictures(const MeshTexture& texture,
                                          std::vector<std::string>* warnings);

}  // namespace isomatch
