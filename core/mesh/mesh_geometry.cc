#include "core/mesh/mesh_geometry.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace isomatch {
namespace {

/// Normal of a face, twice its area long.
Eigen::RowVector3d DoubleAreaNormal(const Positions& positions,
                                    const Faces& faces, VertexIndex face) {
  const Eigen::RowVector3d a = positions.row(faces(face, 0));
  const Eigen::RowVector3d b = positions.row(faces(face, 1));
  const Eigen::RowVector3d c = positions.row(faces(face, 2));
  return (b - a).cross(c - a);
}

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// The lengths of the faces' edges added up, until they are `enough`.
double PerimetersUpTo(const TriangleMesh& mesh, double enough) {
  double sum = 0;
  for (VertexIndex f = 0; f < mesh.num_faces() && sum < enough; ++f) {
    for (int corner = 0; corner < 3; ++corner) {
      sum += (mesh.positions.row(mesh.faces(f, corner)) -
              mesh.positions.row(mesh.faces(f, (corner + 1) % 3)))
                 .norm();
    }
  }
  return sum;
}

}  // namespace

double FaceArea(const TriangleMesh& mesh, VertexIndex face) {
  return 0.5 * DoubleAreaNormal(mesh.positions, mesh.faces, face).norm();
}

FaceExtent ExtentOf(const TriangleMesh& mesh, VertexIndex face) {
  FaceExtent extent;
  for (int corner = 0; corner < 3; ++corner) {
    extent.longest = std::max(
        extent.longest, (mesh.positions.row(mesh.faces(face, corner)) -
                         mesh.positions.row(mesh.faces(face, (corner + 1) % 3)))
                            .norm());
  }
  if (extent.longest > 0) {
    extent.height = 2 * FaceArea(mesh, face) / extent.longest;
  }
  return extent;
}

double SurfaceArea(const TriangleMesh& mesh) {
  double area = 0;
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    area += FaceArea(mesh, f);
  }
  return area;
}

Positions VertexNormals(const Positions& positions, const Faces& faces) {
  Positions normals = Positions::Zero(positions.rows(), 3);
  for (VertexIndex f = 0; f < faces.rows(); ++f) {
    const Eigen::RowVector3d normal = DoubleAreaNormal(positions, faces, f);
    for (int corner = 0; corner < 3; ++corner) {
      normals.row(faces(f, corner)) += normal;
    }
  }
  for (Eigen::Index v = 0; v < normals.rows(); ++v) {
    const double length = normals.row(v).norm();
    if (length > 0) normals.row(v) /= length;
  }
  return normals;
}

Positions VertexNormals(const TriangleMesh& mesh) {
  return VertexNormals(mesh.positions, mesh.faces);
}

double SignedVolume6(const TriangleMesh& mesh, VertexIndex face,
                     const Eigen::RowVector3d& origin) {
  const Eigen::RowVector3d a = mesh.positions.row(mesh.faces(face, 0)) - origin;
  const Eigen::RowVector3d b = mesh.positions.row(mesh.faces(face, 1)) - origin;
  const Eigen::RowVector3d c = mesh.positions.row(mesh.faces(face, 2)) - origin;
  return a.dot(b.cross(c));
}

double MeanEdgeLength(const TriangleMesh& mesh) {
  const double sum = PerimetersUpTo(mesh, kInfinity);
  return mesh.num_faces() > 0 ? sum / (3.0 * mesh.num_faces()) : 0;
}

Eigen::AlignedBox3d BoxOfFaces(const TriangleMesh& mesh) {
  const std::vector<bool> is_on_face = VerticesOnFaces(mesh);
  Eigen::AlignedBox3d box;
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    if (is_on_face[v]) box.extend(mesh.positions.row(v).transpose());
  }
  return box;
}

std::vector<bool> VerticesOnFaces(const TriangleMesh& mesh) {
  std::vector<bool> is_on_face(static_cast<std::size_t>(mesh.num_vertices()));
  for (const VertexIndex corner : mesh.faces.reshaped<Eigen::RowMajor>()) {
    is_on_face[static_cast<std::size_t>(corner)] = true;
  }
  return is_on_face;
}

std::optional<SingleRounding> CoarseRounding(const TriangleMesh& mesh) {
  constexpr int kBits = 24;
  constexpr double kMostOfAnEdge = 0.01;
  const Eigen::AlignedBox3d box = BoxOfFaces(mesh);
  SingleRounding rounding;
  rounding.farthest =
      box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs()).maxCoeff();
  rounding.most = std::ldexp(rounding.farthest, -kBits);
  // Of most meshes a few faces tell.
  const double enough = rounding.most / kMostOfAnEdge * 3 * mesh.num_faces();
  const double sum = PerimetersUpTo(mesh, enough);
  if (sum >= enough) return std::nullopt;
  rounding.mean_edge = sum / (3.0 * mesh.num_faces());
  return rounding;
}

}  // namespace isomatch
