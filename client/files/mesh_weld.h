#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// How near vertices of a mesh are taken for one: a length in mesh units, or a
/// part of the diagonal of the bounding box.
struct WeldTolerance {
  double value = 0;
  bool is_of_diagonal = false;

  double LengthFor(const TriangleMesh& mesh) const;
};

/// Returns what "1e-6" (mesh units) or "0.01%" (of the diagonal) says.
/// INVALID_ARGUMENT: anything but a finite number above 0, of the diagonal at
/// most a tenth.
absl::StatusOr<WeldTolerance> ParseWeldTolerance(const std::string& text);

/// Moves vertices to the first one of the file that is within the tolerance, so
/// that they have one position: cleaning then joins those on rims, as it does
/// with seams. A vertex that was moved does not draw others to itself. Numbers
/// and count of the vertices stay, so maps are those of the file. Numbers of
/// faces do not: those that lose their area inside the surface go, and where a
/// vertex has none left, copies of others hold it to its place. Only what
/// vanishes whole, a component smaller than the tolerance, is on no face any
/// more. Returns how many vertices were moved.
///
/// INVALID_ARGUMENT without a path: a tolerance above a tenth of the diagonal,
/// or no face is left, or none that has an area. Time O(n).
absl::StatusOr<VertexIndex> WeldVertices(const WeldTolerance& tolerance,
                                         TriangleMesh* mesh);

/// A mesh that falls apart although its parts all but touch, as a triangle soup
/// does whose corners were rounded.
struct WeldAdvice {
  std::int64_t components = 0;
  /// Components that have a vertex within `distance` of another component.
  std::int64_t close = 0;
  /// What nearly all vertices that are close to another component have to it.
  double distance = 0;
  /// A tolerance, in mesh units, that joins them.
  double tolerance = 0;

  /// In words, with what to do.
  std::string Text() const;
};

/// Returns advice where components (equal places count as joined) are many and
/// most of them lie within a twentieth of a mean edge of another. Time O(n).
std::optional<WeldAdvice> AdviseWeld(const TriangleMesh& mesh);

}  // namespace isomatch
