#pragma once

#include <cstdint>

#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// Vertices and faces of a mesh.
struct MeshSize {
  std::int64_t vertices = 0;
  std::int64_t faces = 0;
};

inline MeshSize SizeOf(const TriangleMesh& mesh) {
  return {mesh.num_vertices(), mesh.num_faces()};
}

}  // namespace isomatch
