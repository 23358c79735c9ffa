#pragma once

#include <functional>
#include <string>

#include "absl/types/span.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// A property of the vertices of a PLY file to be written.
struct PlyColumn {
  enum class Type { kFloat, kInt, kUchar };
  std::string name;
  Type type = Type::kFloat;
  /// The value of a vertex; in the range of the type.
  std::function<double(VertexIndex)> value;
};

/// Returns the bytes of a binary little-endian PLY file: single-precision
/// coordinates, then `columns`, of each vertex, and the triangles.
std::string FormatPly(const TriangleMesh& mesh,
                      absl::Span<const PlyColumn> columns = {});

}  // namespace isomatch
