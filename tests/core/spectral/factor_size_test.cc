#include "core/spectral/factor_size.h"

#include <cstdint>
#include <limits>

#include <gtest/gtest.h>
#include <Eigen/SparseCholesky>

#include "core/mesh/clean_mesh.h"
#include "core/spectral/cotan_laplacian.h"
#include "tests/support/extreme_meshes.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::HasSubstr;
using Matrix = Eigen::SparseMatrix<double>;

constexpr std::int64_t kAll = std::numeric_limits<std::int64_t>::max();

Matrix StiffnessOf(const TriangleMesh& mesh) {
  return BuildCotanLaplacian(Clean(mesh).mesh).stiffness;
}

/// Counted in a factor.
std::int64_t EntriesOfFactor(Matrix matrix) {
  matrix.diagonal().array() += 1;
  const Eigen::SimplicialLLT<Matrix> cholesky(matrix);
  EXPECT_EQ(cholesky.info(), Eigen::Success);
  return Matrix(cholesky.matrixL()).nonZeros();
}

TEST(FactorSizeTest, CountsTheEntriesOfTheFactor) {
  for (const TriangleMesh& mesh :
       {Tetrahedron(), UnitSphere(3), PlaneGrid(30, 20, 1, 1), Torus(30, 10),
        Fan(200), Book(200), AnyFaces(300)}) {
    const Matrix stiffness = StiffnessOf(mesh);
    EXPECT_EQ(CountFactorEntries(stiffness, kAll), EntriesOfFactor(stiffness));
  }
}

TEST(FactorSizeTest, EndsSoonAfterTheMost) {
  const Matrix stiffness = StiffnessOf(AnyFaces(2000));
  const std::int64_t all = CountFactorEntries(stiffness, kAll);
  EXPECT_GT(all, 500'000);
  const std::int64_t found = CountFactorEntries(stiffness, 100'000);
  EXPECT_GT(found, 100'000);
  EXPECT_LE(found, 100'000 + 2000);  // at most a row more
  EXPECT_EQ(CountFactorEntries(stiffness, all), all);
}

TEST(FactorSizeTest, SurfacesHaveRoomToSpare) {
  for (const TriangleMesh& mesh :
       {UnitSphere(6), PlaneGrid(150, 150, 1, 1), PlaneGrid(1000, 20, 1, 1),
        Torus(200, 100), FiveArms(6), Fan(10'000), Book(10'000)}) {
    const Matrix stiffness = StiffnessOf(mesh);
    const std::int64_t n = stiffness.cols();
    EXPECT_LE(2 * CountFactorEntries(stiffness, kAll), MostFactorEntries(n))
        << n << " vertices";
    EXPECT_THAT(CheckFactor(stiffness), IsOk());
  }
}

TEST(FactorSizeTest, FacesBetweenAnyVerticesAreRefused) {
  EXPECT_THAT(CheckFactor(StiffnessOf(AnyFaces(1000))), IsOk());
  EXPECT_THAT(CheckFactor(StiffnessOf(AnyFaces(4000))),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("do its faces join the right vertices?")));
}

}  // namespace
}  // namespace isomatch
