#pragma once

#include <string>

#include "client/files/mesh_file.h"

namespace isomatch {

/// What an OBJ file has beside the mesh; null for nothing.
struct ObjExtras {
  const MeshTexture* texture = nullptr;
  const Colors* colors = nullptr;
};

/// Returns the text of an OBJ file that is to be at `path`, from whose folder
/// the libraries are named. Numbers read back the same; colors are fractions
/// of three digits after `v x y z`.
std::string FormatObj(const std::string& path, const TriangleMesh& mesh,
                      const ObjExtras& extras);

}  // namespace isomatch
