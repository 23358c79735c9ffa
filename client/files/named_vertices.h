#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// A vertex that somebody pointed at, with or without a name.
struct NamedVertex {
  VertexIndex vertex = kNoVertex;
  std::string name;
};

/// Returns the vertices of a file of lines `VERTEX [NAME]`, 0-based; a name may
/// have blanks, # starts a comment.
///
/// INVALID_ARGUMENT, naming file and line, what was found and what was
/// expected: no number, a vertex that `mesh` does not have or that is on no
/// face, no line at all; NOT_FOUND.
absl::StatusOr<std::vector<NamedVertex>> ReadNamedVertices(
    const std::string& path, const TriangleMesh& mesh);

/// Returns the text of such a file.
std::string FormatNamedVertices(absl::Span<const NamedVertex> vertices);

}  // namespace isomatch
