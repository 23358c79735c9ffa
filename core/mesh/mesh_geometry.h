#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// Area of one face, squared mesh units.
double FaceArea(const TriangleMesh& mesh, VertexIndex face);

/// Sum of the areas of all faces, squared mesh units.
double SurfaceArea(const TriangleMesh& mesh);

/// Returns n x 3 unit vectors: at each vertex the normalized sum of its faces'
/// normals weighted by area. Zero where the faces cancel out or there are none.
Positions VertexNormals(const TriangleMesh& mesh);
Positions VertexNormals(const Positions& positions, const Faces& faces);

/// How long a face is at its longest edge, and how high over that; mesh units.
struct FaceExtent {
  double longest = 0;
  double height = 0;

  /// The area is rounding.
  bool is_flat() const { return height <= 1e-9 * longest; }
};
FaceExtent ExtentOf(const TriangleMesh& mesh, VertexIndex face);

/// Volume, in units of area^1.5, below which its sign is rounding.
inline constexpr double kFlatVolume = 1e-6;

/// Six times the oriented volume between face `face` and `origin`.
double SignedVolume6(const TriangleMesh& mesh, VertexIndex face,
                     const Eigen::RowVector3d& origin);

/// Mean length over the edges of all faces (an edge of two faces counts
/// twice), mesh units. 0 without faces.
double MeanEdgeLength(const TriangleMesh& mesh);

/// The box of the faces: vertices on none do not count. Empty without faces.
Eigen::AlignedBox3d BoxOfFaces(const TriangleMesh& mesh);

/// Which vertices are a face's.
std::vector<bool> VerticesOnFaces(const TriangleMesh& mesh);

/// What coordinates of single precision do to a mesh far from the origin.
struct SingleRounding {
  double farthest = 0;   ///< largest magnitude of a coordinate on a face
  double most = 0;       ///< that such a coordinate is rounded by
  double mean_edge = 0;  ///< mesh units, as all of them
};

/// Where the shape suffers from it: coordinates are rounded by more than a
/// hundredth of the mean edge. REQUIRES: a face.
std::optional<SingleRounding> CoarseRounding(const TriangleMesh& mesh);

}  // namespace isomatch
