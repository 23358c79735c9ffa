#include "core/matching/insertion.h"

#include <algorithm>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/hashed_test_shape.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

class InsertionTest : public testing::Test {
 protected:
  InsertionTest() : shape_(FiveArms(3), /*pool_size=*/0) {}

  /// A matching of the shape with itself that begins with five right matches.
  Matching Begin(int capacity) const {
    Matching matching(shape_.pool(), shape_.pool(), capacity);
    for (int p = 0; p < 5; ++p) matching.Add({p, p});
    return matching;
  }

  const HashedTestShape shape_;
};

TEST_F(InsertionTest, PicksTheUnmatchedPointOfLeastError) {
  const Matching matching = Begin(5);
  const int x = matching.FarthestUnmatched(kX);
  const int best = CandidateSearch().Best(matching, kX, x);
  std::vector<float> errors;
  matching.EmbeddingErrors(kX, x, &errors);
  for (int y = 0; y < shape_.pool().size(); ++y) {
    if (matching.is_matched(kY, y)) continue;
    EXPECT_LE(errors[best], errors[y]);
  }
}

TEST_F(InsertionTest, EnvironmentsOfTheBestBasisPointsBoundTheSearch) {
  const CandidateSearch search(shape_.basis(), shape_.pool());
  Matching matching = Begin(100);
  for (int i = 0; i < 90; ++i) {
    const int x = matching.FarthestUnmatched(kX);
    const int y = search.Best(matching, kX, x);
    ASSERT_FALSE(matching.is_matched(kY, y));
    // The three basis points of least error, by brute force.
    std::vector<float> errors;
    matching.EmbeddingErrors(kX, x, &errors);
    std::vector<int> basis(shape_.basis().num_points());
    for (std::size_t z = 0; z < basis.size(); ++z) basis[z] = int(z);
    std::sort(basis.begin(), basis.end(), [&](int a, int b) {
      return std::pair(errors[a], a) < std::pair(errors[b], b);
    });
    const std::vector<int> near =
        shape_.basis().Nearest(shape_.pool().vertex(y), 3);
    EXPECT_TRUE(std::any_of(near.begin(), near.end(), [&](int z) {
      return z == basis[0] || z == basis[1] || z == basis[2];
    }));
    matching.Add({x, y});
  }
}

TEST_F(InsertionTest, AShapeIsMatchedToItselfPointByPoint) {
  for (const bool environments : {false, true}) {
    const CandidateSearch search =
        environments ? CandidateSearch(shape_.basis(), shape_.pool())
                     : CandidateSearch();
    Matching matching = Begin(60);
    for (int i = 5; i < 60; ++i) {
      ASSERT_TRUE(InsertFrom(i % 2 == 0 ? kX : kY, search, &matching));
    }
    for (const PointMatch& match : matching.Matches()) {
      EXPECT_EQ(match.x, match.y);
    }
  }
}

TEST_F(InsertionTest, SaysSoWhenASideIsUsedUp) {
  const HashedTestShape small(Tetrahedron(), /*pool_size=*/0);
  Matching matching(shape_.pool(), small.pool(), 10);
  for (int p = 0; p < 4; ++p) matching.Add({p, p});
  EXPECT_FALSE(InsertFrom(kX, CandidateSearch(), &matching));
  EXPECT_FALSE(InsertFrom(kY, CandidateSearch(), &matching));
  EXPECT_EQ(matching.size(), 4);
}

}  // namespace
}  // namespace isomatch
