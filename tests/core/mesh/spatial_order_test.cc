#include "core/mesh/spatial_order.h"

#include <algorithm>
#include <numeric>

#include <gtest/gtest.h>

#include "tests/support/shapes.h"

namespace isomatch {
namespace {

double MeanStep(const TriangleMesh& mesh,
                const std::vector<VertexIndex>& order) {
  double sum = 0;
  for (std::size_t i = 1; i < order.size(); ++i) {
    sum += (mesh.positions.row(order[i]) - mesh.positions.row(order[i - 1]))
               .norm();
  }
  return sum / static_cast<double>(order.size() - 1);
}

TEST(SpatialOrderTest, IsAPermutationThatKeepsNeighborsTogether) {
  const TriangleMesh mesh =
      Relabeled(FiveArms(4), RandomPermutation(2562, /*seed=*/1));
  std::vector<VertexIndex> given(mesh.num_vertices());
  std::iota(given.begin(), given.end(), 0);
  std::vector<VertexIndex> order = SpatialOrder(mesh.positions);
  EXPECT_LT(MeanStep(mesh, order), 0.25 * MeanStep(mesh, given));
  std::sort(order.begin(), order.end());
  EXPECT_EQ(order, given);
}

TEST(SpatialOrderTest, VerticesInOnePlaceStayInOrder) {
  const Positions same = Positions::Ones(5, 3);
  EXPECT_EQ(SpatialOrder(same), (std::vector<VertexIndex>{0, 1, 2, 3, 4}));
}

}  // namespace
}  // namespace isomatch
