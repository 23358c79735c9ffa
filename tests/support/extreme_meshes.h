#pragma once

#include <cstdint>
#include <string>

#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// `pages` faces on one edge.
TriangleMesh Book(VertexIndex pages);

/// `faces` faces around one vertex, a closed rim.
TriangleMesh Fan(VertexIndex faces);

/// A mesh that nobody means well with, and what it is, in words.
struct ExtremeMesh {
  std::string description;
  TriangleMesh mesh;
};

/// Makes one at random: a surface, fan, book, soup or nonsense of mostly a few
/// hundred vertices, at times some thousand, of which some vertices, axes or
/// all are moved or scaled by anything that single precision holds (1e-45 to
/// 3e38), with repeated, flipped and flat faces, coinciding vertices,
/// non-manifold edges and vertices. Coordinates are finite and rounded to
/// single precision, as Draco gives them. The same for the same seed.
ExtremeMesh RandomExtremeMesh(std::uint64_t seed);

}  // namespace isomatch
