#pragma once

#include <string>
#include <vector>

#include "client/files/mesh_file.h"

namespace isomatch {

/// What a GLB file has beside the mesh; null for nothing.
struct GlbExtras {
  const MeshTexture* texture = nullptr;
  const Colors* colors = nullptr;
  /// For each of the texture's materials the bytes of its picture, a PNG or
  /// JPEG file; "" or beyond the end for none.
  std::vector<std::string> pictures = {};
};

/// Returns the bytes of a binary glTF 2.0 file, the same for the same mesh.
/// Coordinates are in single precision; colors, [0, 1], become COLOR_0, linear
/// of 16 bits; materials embed their pictures and have nothing else.
///
/// The first vertices are the mesh's. glTF has one pair of texture coordinates
/// for each vertex, so copies of those that have several follow them. Faces are
/// in the mesh's order, those of one material together.
std::string FormatGlb(const TriangleMesh& mesh, const GlbExtras& extras);

}  // namespace isomatch
