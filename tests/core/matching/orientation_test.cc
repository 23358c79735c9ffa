#include "core/matching/orientation.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "core/mesh/mesh_geometry.h"
#include "tests/support/hashed_test_shape.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

/// The mirror image in the plane z = 0, outward again.
TriangleMesh Mirrored(TriangleMesh mesh) {
  mesh.positions.col(2) *= -1;
  mesh.faces.col(1).swap(mesh.faces.col(2));
  return mesh;
}

Matching IdentityMatching(const HashedTestShape& x, const HashedTestShape& y,
                          int count) {
  Matching matching(x.pool(), y.pool(), count);
  for (int p = 0; p < count; ++p) matching.Add({p, p});
  return matching;
}

TEST(OrientationScoreTest, IsOneForARotatedCopyAndMinusOneForAMirrorImage) {
  const HashedTestShape x(FiveArms(3), /*pool_size=*/100);
  const HashedTestShape rotated(Moved(FiveArms(3), 2), /*pool_size=*/100);
  const HashedTestShape mirrored(Mirrored(FiveArms(3)), /*pool_size=*/100);
  EXPECT_GT(OrientationScore(IdentityMatching(x, rotated, 60), x.frames(),
                             rotated.frames()),
            0.99);
  EXPECT_LT(OrientationScore(IdentityMatching(x, mirrored, 60), x.frames(),
                             mirrored.frames()),
            -0.99);
}

TEST(OrientationScoreTest, TurnsWithTheNormals) {
  const HashedTestShape x(FiveArms(3), /*pool_size=*/100);
  PointFrames inside_out = x.frames();
  inside_out.normals *= -1;
  EXPECT_LT(
      OrientationScore(IdentityMatching(x, x, 60), x.frames(), inside_out),
      -0.99);
}

TEST(CurvatureMismatchTest, IsTheMeanDifferenceAtTheMatches) {
  const HashedTestShape x(FiveArms(3), /*pool_size=*/100);
  PointFrames bent = x.frames();
  EXPECT_EQ(
      CurvatureMismatch(IdentityMatching(x, x, 4), x.frames(), x.frames()), 0);
  bent.curvatures[0] += 3;
  bent.curvatures[2] -= 1;
  bent.curvatures[50] += 100;  // not matched
  EXPECT_DOUBLE_EQ(
      CurvatureMismatch(IdentityMatching(x, x, 4), x.frames(), bent), 1);
  EXPECT_EQ(CurvatureMismatch(IdentityMatching(x, x, 0), x.frames(), bent), 0);
}

TEST(OrientationScoreTest, TwoMatchesSayNothing) {
  const HashedTestShape x(FiveArms(3), /*pool_size=*/100);
  EXPECT_EQ(OrientationScore(IdentityMatching(x, x, 2), x.frames(), x.frames()),
            0);
}

TEST(LocalOrientationsTest, AreNegativeWhereARegionIsMirrored) {
  const HashedTestShape body(MirrorSymmetricBody(3), /*pool_size=*/200);
  const Positions& positions = body.frames().positions;
  Matching matching(body.pool(), body.pool(), 200);
  std::vector<bool> mirrored;
  for (int p = 0; p < 200; ++p) {
    Eigen::RowVector3d image = positions.row(p);
    const bool flip = image[0] > 0.3;
    if (flip) image[2] *= -1;
    Eigen::Index y;
    (positions.rowwise() - image).rowwise().norm().minCoeff(&y);
    if (matching.is_matched(kY, static_cast<int>(y))) continue;
    matching.Add({p, static_cast<int>(y)});
    mirrored.push_back(flip);
  }
  const std::vector<double> local =
      LocalOrientations(matching, body.frames(), body.frames());
  int right = 0;
  for (std::size_t i = 0; i < local.size(); ++i) {
    EXPECT_LE(std::abs(local[i]), 1);
    right += (local[i] < 0) == mirrored[i];
  }
  EXPECT_GT(right, 0.9 * double(local.size()));
}

}  // namespace
}  // namespace isomatch
