#include "core/pipeline/component_matching.h"

#include <algorithm>
#include <map>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/pipeline/matcher.h"
#include "tests/support/dirty_meshes.h"
#include "tests/support/matchers.h"
#include "tests/support/quick_options.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

/// Several meshes side by side along z.
TriangleMesh Row(const std::vector<TriangleMesh>& meshes) {
  DirtyMesh all = Untouched(meshes[0]);
  for (std::size_t i = 1; i < meshes.size(); ++i) {
    TriangleMesh mesh = meshes[i];
    mesh.positions.col(2).array() += 9.0 * static_cast<double>(i);
    all = Joined(all, Untouched(mesh), 0);
  }
  return all.mesh;
}

TriangleMesh Scaled(TriangleMesh mesh, double scale) {
  mesh.positions *= scale;
  return mesh;
}

/// The component of Y that each component of X goes to.
SplitMesh SplitOf(const TriangleMesh& mesh) {
  return SplitIntoComponents(mesh, {}).value();
}

std::map<int, int> YFromX(const SplitMesh& split,
                          const std::vector<ComponentPair>& pairs) {
  std::map<int, int> y_from_x;
  for (const ComponentPair& pair : pairs) {
    y_from_x[split.large[pair.x]] = split.large[pair.y];
  }
  return y_from_x;
}

TEST(PartsTest, LargeOnesComeBySizeAndSmallOnesNotAtAll) {
  const SplitMesh split = SplitOf(Row(
      {UnitSphere(2), Scaled(FiveArms(2), 1.5), Scaled(Tetrahedron(), 0.1)}));
  EXPECT_EQ(split.large, (std::vector<int>{1, 0}));
  EXPECT_GT(split.areas[0], split.areas[1]);
}

TEST(PartsTest, ArePairedBySizeAndLength) {
  const TriangleMesh plane = PlaneGrid(10, 10, 4, 4);
  const TriangleMesh strip = PlaneGrid(40, 4, 16, 1);  // of equal area
  const SplitMesh x = SplitOf(Row({plane, strip, UnitSphere(2)}));
  const SplitMesh y = SplitOf(Row({UnitSphere(2), strip, plane}));
  ASSERT_EQ(x.large.size(), 3u);
  const auto pairs = PairComponents(x, y, {}, {});
  ASSERT_THAT(pairs, IsOk());
  for (const ComponentPair& pair : *pairs) {
    EXPECT_EQ(x.large[pair.x] + y.large[pair.y], 2);  // the row is reversed
  }
}

TEST(PartsTest, EqualOnesArePairedByPlaceUnlessLandmarksSayOtherwise) {
  const SplitMesh split =
      SplitOf(Row({UnitSphere(2), UnitSphere(2), UnitSphere(2)}));
  EXPECT_EQ(YFromX(split, *PairComponents(split, split, {}, {})),
            (std::map<int, int>{{0, 0}, {1, 1}, {2, 2}}));
  constexpr VertexIndex kEach = 162;
  const std::vector<Landmark> crossing = {{3, 2 * kEach + 3}};
  EXPECT_EQ(YFromX(split, *PairComponents(split, split, crossing, {})).at(0),
            2);
}

TEST(MatchByComponentsTest, OneWithoutACounterpartFollowsAndIsReported) {
  const TriangleMesh two = Row({FiveArms(3), Scaled(BumpySphere(3), 0.7)});
  const TriangleMesh one = FiveArms(3);
  const auto found = Match(two, one, {}, QuickOptions());
  ASSERT_THAT(found, IsOk());
  int right = 0;
  for (VertexIndex v = 0; v < one.num_vertices(); ++v) {
    right += found->y_from_x[v] == v;
  }
  EXPECT_GT(right, 0.95 * one.num_vertices());
  EXPECT_THAT(found->y_from_x, testing::Each(testing::Ge(0)));
  EXPECT_THAT(found->warnings,
              testing::Contains(testing::HasSubstr("no counterpart")));
  EXPECT_EQ(found->confidence.size(), std::size_t(two.num_vertices()));
}

TEST(MatchByComponentsTest, EveryVertexOfYOnAFaceIsMatched) {
  TriangleMesh two = Row({FiveArms(2), Scaled(BumpySphere(2), 0.8)});
  const Eigen::Index n = two.num_vertices();
  const auto x = two;
  two.positions.conservativeResize(n + 1, Eigen::NoChange);
  two.positions.row(n).setConstant(9);  // on no face
  const auto found = Match(x, two, {}, {});
  ASSERT_THAT(found, IsOk());
  std::vector<char> all_but_the_last(std::size_t(n) + 1, 1);
  all_but_the_last.back() = 0;
  EXPECT_EQ(found->matched_y, all_but_the_last);
}

TEST(MatchByComponentsTest, ProgressRisesOverAllParts) {
  const TriangleMesh two = Row({FiveArms(2), Scaled(BumpySphere(2), 0.8)});
  std::vector<double> totals;
  const auto found = Match(two, two, {}, {}, {[&](const Progress& progress) {
                             totals.push_back(progress.total_fraction);
                           }});
  ASSERT_THAT(found, IsOk());
  EXPECT_TRUE(std::is_sorted(totals.begin(), totals.end()));
  EXPECT_NEAR(totals.back(), 1, 1e-9);
}

}  // namespace
}  // namespace isomatch
