#pragma once

#include "absl/status/statusor.h"
#include "client/sample/animal_body.h"
#include "core/base/random_stream.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// Returns the surface of `body` at rest as a closed genus-0 manifold, outward,
/// of exactly `vertices` vertices at about even distances. Different states of
/// `random` give triangulations that have nothing in common.
///
/// REQUIRES: vertices >= 100. INTERNAL when so few cannot carry the shape.
/// Time O(vertices), about 10 s for a million on two cores.
absl::StatusOr<TriangleMesh> MeshSurface(const AnimalBody& body, int vertices,
                                         RandomStream& random);

}  // namespace isomatch
