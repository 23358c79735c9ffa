#include "core/spectral/zoomout.h"

#include <vector>

#include <gtest/gtest.h>

#include "core/mesh/vertex_stars.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

class ZoomOutTest : public testing::Test {
 protected:
  ZoomOutTest()
      : permutation_(RandomPermutation(mesh_.num_vertices(), /*seed=*/5)),
        mesh_y_(Relabeled(mesh_, permutation_)),
        stars_x_(mesh_),
        stars_y_(mesh_y_),
        basis_x_(*ComputeSpectralBasis(BuildCotanLaplacian(mesh_), 60, {})),
        basis_y_(*ComputeSpectralBasis(BuildCotanLaplacian(mesh_y_), 60, {})) {}

  SpectralSurface x() const { return {basis_x_, stars_x_}; }
  SpectralSurface y() const { return {basis_y_, stars_y_}; }

  /// Every 40th vertex right, the others unmatched.
  VertexMap Sparse() const {
    VertexMap sparse(permutation_.size(), kNoVertex);
    for (std::size_t v = 0; v < sparse.size(); v += 40) {
      sparse[v] = permutation_[v];
    }
    return sparse;
  }

  const TriangleMesh mesh_ = FiveArms(3);
  const std::vector<VertexIndex> permutation_;
  const TriangleMesh mesh_y_;
  const VertexStars stars_x_;
  const VertexStars stars_y_;
  const SpectralBasis basis_x_;
  const SpectralBasis basis_y_;
};

TEST_F(ZoomOutTest, SixteenMatchesGrowToTheWholePermutation) {
  std::vector<double> fractions;
  const auto map =
      ZoomOut(x(), y(), Sparse(), {6, 60, 6},
              {[&](double fraction) { fractions.push_back(fraction); }});
  ASSERT_THAT(map, IsOk());
  EXPECT_EQ(*map, permutation_);
  EXPECT_EQ(fractions.size(), 10u);
  EXPECT_EQ(fractions.back(), 1);
}

TEST_F(ZoomOutTest, SizesBeyondTheBasesAreCut) {
  const auto map = ZoomOut(x(), y(), permutation_, {100, 500, 7}, {});
  ASSERT_THAT(map, IsOk());
  EXPECT_EQ(*map, permutation_);
}

TEST_F(ZoomOutTest, StopsWhenAsked) {
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THAT(
      ZoomOut(x(), y(), Sparse(), {}, {.stop = stop.get_token()}).status(),
      StatusIs(absl::StatusCode::kCancelled, testing::_));
}

}  // namespace
}  // namespace isomatch
