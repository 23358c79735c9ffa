#include "core/descriptor/point_differences.h"

#include <cmath>
#include <numeric>
#include <vector>

#include <gtest/gtest.h>

#include "core/geodesic/rim_distance.h"
#include "core/mesh/mesh_geometry.h"
#include "core/spectral/cotan_laplacian.h"
#include "tests/support/dirty_meshes.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

constexpr ShotBall kBalls[] = {{0.15}, {0.3}};

/// A mesh with all that descriptors want.
struct RimmedSurface {
  explicit RimmedSurface(TriangleMesh shape)
      : mesh(std::move(shape)),
        normals(VertexNormals(mesh)),
        areas(BuildCotanLaplacian(mesh).mass),
        stars(mesh),
        rim(RimDistances(mesh, DistanceFieldSolver(mesh))) {}

  PointDescriptors At(const std::vector<VertexIndex>& vertices) const {
    return *DescribePoints({mesh, normals, areas, stars}, vertices, rim, kBalls,
                           {});
  }

  TriangleMesh mesh;
  Positions normals;
  Eigen::VectorXd areas;
  VertexStars stars;
  std::vector<float> rim;
};

std::vector<VertexIndex> EveryTenth(VertexIndex count) {
  std::vector<VertexIndex> vertices;
  for (VertexIndex v = 0; v < count; v += 10) vertices.push_back(v);
  return vertices;
}

TEST(PointDifferencesTest, APointIsMostLikeItselfOnAMovedShape) {
  TriangleMesh mesh = FiveArms(4);
  mesh.positions /= std::sqrt(SurfaceArea(mesh));
  const RimmedSurface x(mesh);
  const RimmedSurface y(Moved(mesh, 1));
  const std::vector<VertexIndex> vertices = EveryTenth(x.mesh.num_vertices());
  const Eigen::MatrixXf differences =
      PointDifferences(x.At(vertices), y.At(vertices));
  int right = 0;
  int alike = 0;
  for (Eigen::Index i = 0; i < differences.cols(); ++i) {
    Eigen::Index most_alike = 0;
    differences.col(i).minCoeff(&most_alike);
    right += most_alike == i;
    alike += differences(i, i) < 0.01;
  }
  EXPECT_GT(right, 0.98 * double(differences.cols()));
  EXPECT_GT(alike, 0.95 * double(differences.cols()));
  EXPECT_GE(differences.minCoeff(), -1e-5);
  EXPECT_LE(differences.maxCoeff(), 2.001);
}

TEST(PointDifferencesTest, BallsThatTheRimCutsAreTrustedLess) {
  const DirtyMesh half = WithoutLoneVertices(
      WithoutFaces(Untouched(UnitSphere(4)), Beyond({0, 0, 1}, 0.0)));
  const RimmedSurface x(half.mesh);
  std::vector<VertexIndex> all(x.mesh.num_vertices());
  std::iota(all.begin(), all.end(), 0);
  const PointDescriptors described = x.At(all);
  for (const VertexIndex v : all) {
    for (int r = 0; r < 2; ++r) {
      const double part = std::min(1.0, x.rim[v] / kBalls[r].radius);
      const double expected = part < 0.15 ? 0.15 * 0.15 : part * part;
      EXPECT_NEAR(described.trust(r, v), expected, 1e-5);
    }
  }
}

TEST(PointDifferencesTest, OneRadiusThatIsNotTrustedHardlyCounts) {
  PointDescriptors x = {{PointColumns(2, 1), PointColumns(2, 1)}, {}};
  PointDescriptors y = x;
  x.columns[0] << 1, 0;
  y.columns[0] << 1, 0;  // alike
  x.columns[1] << 1, 0;
  y.columns[1] << 0, 1;  // as unlike as can be
  x.trust = Eigen::MatrixXf::Ones(2, 1);
  y.trust = x.trust;
  EXPECT_NEAR(PointDifferences(x, y)(0, 0), 1, 1e-6);
  x.trust(1, 0) = 0.25;
  EXPECT_NEAR(PointDifferences(x, y)(0, 0), 2 * 0.25 / 1.25, 1e-6);
}

}  // namespace
}  // namespace isomatch
