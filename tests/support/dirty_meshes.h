#pragma once

#include <cstdint>
#include <functional>

#include <Eigen/Core>

#include "core/base/vertex_index.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// A mesh made from a good one, and the way back. Each function below does one
/// kind of damage that real files have; they can be chained.
struct DirtyMesh {
  TriangleMesh mesh;
  /// The vertex of the good mesh that each one is, or is next to; kNoVertex for
  /// one on no face.
  VertexMap origin;
};

/// Says yes or no to face number `face` of `mesh`.
using FacePredicate =
    std::function<bool(const TriangleMesh& mesh, VertexIndex face)>;

/// Says yes to about `fraction` of the faces, at random.
FacePredicate AtRandom(double fraction, std::uint64_t seed);
/// Says yes to the faces whose middle lies beyond `height` along `direction`.
FacePredicate Beyond(const Eigen::RowVector3d& direction, double height);

/// `mesh` as it is.
DirtyMesh Untouched(const TriangleMesh& mesh);
/// Without some faces; vertices that lose their last one stay, on no face.
DirtyMesh WithoutFaces(const DirtyMesh& dirty, const FacePredicate& remove);
/// Renumbered without the vertices that are on no face.
DirtyMesh WithoutLoneVertices(const DirtyMesh& dirty);
/// What is left of `whole` without some faces, relabeled and moved, in a unit
/// that is `scale` times smaller.
DirtyMesh MovedPart(const TriangleMesh& whole, const FacePredicate& remove,
                    std::uint64_t seed, double scale);
/// With some faces turned round.
DirtyMesh WithFlippedFaces(const DirtyMesh& dirty, const FacePredicate& flip);
/// With every face on vertices of its own, as STL files have them.
DirtyMesh TriangleSoup(const DirtyMesh& dirty);
/// With some faces given again: as they are, rotated or turned round.
DirtyMesh WithRepeatedFaces(const DirtyMesh& dirty,
                            const FacePredicate& repeat);
/// With `count` vertices on no face, some of them before all the others, far
/// away.
DirtyMesh WithLoneVertices(const DirtyMesh& dirty, VertexIndex count);
/// With a third face on the first edge of each of some faces: non-manifold
/// edges.
DirtyMesh WithFins(const DirtyMesh& dirty, const FacePredicate& at);
/// With a tetrahedron standing on one corner on the first vertex of each of
/// some faces: non-manifold vertices where two patches touch.
DirtyMesh WithTouchingTetrahedra(const DirtyMesh& dirty,
                                 const FacePredicate& at, double size);
/// With faces that name a vertex twice or thrice.
DirtyMesh WithRepeatedCorners(const DirtyMesh& dirty, const FacePredicate& at);
/// Some faces are cut in two through the middle of their first edge, and the
/// gap is closed with a face of no area: its corners lie on a line.
DirtyMesh WithFlatFaces(const DirtyMesh& dirty, const FacePredicate& at);
/// Some faces get a vertex next to their first corner, at `offset` times the
/// way to the middle: three faces, one of them a needle.
DirtyMesh WithSlivers(const DirtyMesh& dirty, const FacePredicate& at,
                      double offset);
/// The first vertex of each of some faces moves to the place of the second: the
/// edge has no length, and its faces have no area.
DirtyMesh WithCollapsedEdges(const DirtyMesh& dirty, const FacePredicate& at);
/// Cuts some faces in four at the middles of their edges, and their neighbors
/// so that no gap opens.
DirtyMesh Refined(const DirtyMesh& dirty, const FacePredicate& refine);
/// Both as one mesh; origins of `b` begin after `origins_of_a`.
DirtyMesh Joined(const DirtyMesh& a, const DirtyMesh& b,
                 VertexIndex origins_of_a);

/// `mesh` moved by `by` times its largest extent.
TriangleMesh Shifted(const TriangleMesh& mesh, double by);

}  // namespace isomatch
