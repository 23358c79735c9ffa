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

/// Returns the bytes that a mesh of this size holds; a double, since products
/// of hostile sizes must not wrap.
inline double MeshBytes(MeshSize size) {
  return 3.0 * sizeof(double) * static_cast<double>(size.vertices) +
         3.0 * sizeof(VertexIndex) * static_cast<double>(size.faces);
}

}  // namespace isomatch
