#pragma once

#include <cstdint>
#include <vector>

#include "core/base/vertex_index.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// The icosahedron subdivided `levels` times onto the unit sphere: 10 4^levels
/// + 2 vertices, outward.
TriangleMesh UnitSphere(int levels);

/// [0, width] x [0, height] in the plane z = 0, in right triangles: (columns +
/// 1) (rows + 1) vertices, row by row, normals +z.
TriangleMesh PlaneGrid(int columns, int rows, double width, double height);

/// A torus of radii 1 and 0.4 around z: around x across vertices, outward.
TriangleMesh Torus(int around, int across);

/// Four vertices, four faces, all edges of different lengths, outward.
TriangleMesh Tetrahedron();

/// A closed blob without symmetry: the unit sphere with bumps of different
/// heights in different directions, so that it can be matched to itself in
/// one way only.
TriangleMesh BumpySphere(int levels);

/// A closed hand-like star: the sphere with five long arms at uneven angles
/// and of uneven lengths; its extremities make seeds easy.
TriangleMesh FiveArms(int levels);

/// Direction of the fourth of the five arms.
inline const Eigen::RowVector3d kFourthArm(-0.6, -0.9, 0.2);

/// A closed blob with bumps that is its own mirror image in the plane z = 0,
/// and in no other way like itself.
TriangleMesh MirrorSymmetricBody(int levels);

/// `mesh` with vertex v renamed to new_from_old[v].
TriangleMesh Relabeled(const TriangleMesh& mesh,
                       const std::vector<VertexIndex>& new_from_old);

/// A permutation of 0..n-1.
std::vector<VertexIndex> RandomPermutation(VertexIndex n, std::uint64_t seed);

/// Each of 0..n-1 to itself.
std::vector<VertexIndex> IdentityMap(VertexIndex n);

/// How many entries of `found` are those of `truth`, as a fraction.
double FractionRight(const std::vector<VertexIndex>& found,
                     const std::vector<VertexIndex>& truth);

/// `mesh` scaled, rotated and shifted.
TriangleMesh Moved(const TriangleMesh& mesh, double scale);

/// `vertices` random places and three times as many faces between any of them:
/// no surface at all.
TriangleMesh AnyFaces(VertexIndex vertices);

}  // namespace isomatch
