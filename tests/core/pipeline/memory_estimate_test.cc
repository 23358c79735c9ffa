#include <algorithm>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "core/mesh/mesh_size.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/matcher.h"
#include "core/pipeline/memory_estimate.h"
#include "tests/support/dirty_meshes.h"
#include "tests/support/extreme_meshes.h"
#include "tests/support/matchers.h"
#include "tests/support/memory_growth.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

struct MatchBytes {
  std::int64_t measured;
  std::int64_t estimate;
};

/// Matches, and records both.
MatchBytes BytesOfMatch(const TriangleMesh& x, const TriangleMesh& y,
                        const MatchOptions& options) {
  const MemoryGrowth growth;
  EXPECT_THAT(Match(x, y, {}, options), IsOk());
  const MatchBytes bytes = {
      growth.Bytes(), EstimateMemoryBytes(SizeOf(x), SizeOf(y), 0, options)};
  testing::Test::RecordProperty("measured_bytes",
                                std::to_string(bytes.measured));
  testing::Test::RecordProperty("estimate_bytes",
                                std::to_string(bytes.estimate));
  return bytes;
}

class MemoryEstimateTest
    : public testing::TestWithParam<std::pair<Profile, int>> {};

TEST_P(MemoryEstimateTest, IsAnUpperBoundAndNotAWildOne) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers change what a process allocates";
#endif
  const auto [profile, levels] = GetParam();
  const TriangleMesh x = FiveArms(levels);
  const TriangleMesh y = Moved(x, 2);
  MatchOptions options = MatchOptions::ForProfile(profile);
  if (profile == Profile::kPaper) options.max_seeds = 6;
  const auto [measured, estimate] = BytesOfMatch(x, y, options);
  EXPECT_GE(estimate, measured);
  EXPECT_LE(estimate, 2 * measured + (std::int64_t{16} << 20));
}

INSTANTIATE_TEST_SUITE_P(Sizes, MemoryEstimateTest,
                         testing::Values(std::pair{Profile::kDefault, 3},
                                         std::pair{Profile::kDefault, 5},
                                         std::pair{Profile::kPaper, 3},
                                         std::pair{Profile::kPaper, 5}));

/// Says yes to one face of so many, here and there; AtRandom takes longer.
FacePredicate SomeFaces(std::uint32_t of) {
  return [=](const TriangleMesh&, VertexIndex face) {
    return ((static_cast<std::uint32_t>(face) * 2654435769u) >> 16) % of == 0;
  };
}

/// Its name, and what it makes of a good mesh.
using Damage = std::pair<const char*, DirtyMesh (*)(const DirtyMesh&)>;

// While it is cleaned a mesh of these takes most where it is damaged.
class DamagedMeshEstimateTest : public testing::TestWithParam<Damage> {};

TEST_P(DamagedMeshEstimateTest, IsAnUpperBoundAndTight) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers change what a process allocates";
#endif
  const TriangleMesh x = GetParam().second(Untouched(FiveArms(7))).mesh;
  const TriangleMesh y = Moved(x, 2);
  const MatchOptions options;
  const auto [measured, estimate] = BytesOfMatch(x, y, options);
  EXPECT_GE(estimate, measured);
  // Of a soup five in six vertices go, which nobody knows before.
  EXPECT_LE(estimate, measured * 5 / 2);
}

INSTANTIATE_TEST_SUITE_P(
    Damages, DamagedMeshEstimateTest,
    testing::Values(Damage("None", [](const DirtyMesh& mesh) { return mesh; }),
                    Damage("Soup",
                           [](const DirtyMesh& mesh) {
                             return TriangleSoup(mesh);
                           }),
                    Damage("Pierced",
                           [](const DirtyMesh& mesh) {
                             return WithoutFaces(mesh, SomeFaces(10));
                           }),
                    Damage("RepeatedFaces",
                           [](const DirtyMesh& mesh) {
                             return WithRepeatedFaces(mesh, SomeFaces(2));
                           }),
                    Damage("Fins",
                           [](const DirtyMesh& mesh) {
                             return WithFins(mesh, SomeFaces(10));
                           }),
                    Damage("TouchingTetrahedra",
                           [](const DirtyMesh& mesh) {
                             return WithTouchingTetrahedra(mesh, SomeFaces(10),
                                                           0.001);
                           }),
                    Damage("CollapsedEdges",
                           [](const DirtyMesh& mesh) {
                             return WithCollapsedEdges(mesh, SomeFaces(10));
                           })),
    [](const auto& damage) { return std::string(damage.param.first); });

TEST(LargeMeshEstimateTest, HoldsForPartsOfEitherUnit) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers change what a process allocates";
#endif
  const TriangleMesh y = FiveArms(7);
  const TriangleMesh x =
      MovedPart(y, Beyond(kFourthArm.normalized(), 0.6), 1, 2).mesh;
  MatchOptions options;
  options.relation = Relation::kPartOfY;
  const auto [measured, estimate] = BytesOfMatch(x, y, options);
  EXPECT_GE(estimate, measured);
  EXPECT_LE(estimate, measured * 2);
}

// Two vertices of it are in all 2,684 faces: each correction of one of them
// corrects all others, 2.7 million times until the distances are found.
TEST(MemoryEstimateBookTest, CorrectedDistancesDoNotPileUp) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers change what a process allocates";
#endif
  constexpr std::uint64_t kPair = 3662905528 + 2 * 7488;
  const TriangleMesh x = RandomExtremeMesh(kPair).mesh;
  const TriangleMesh y = RandomExtremeMesh(kPair + 1).mesh;
  MatchOptions options;
  options.threads = 1;
  const auto [measured, estimate] = BytesOfMatch(x, y, options);
  EXPECT_LE(measured, estimate * 3 / 4);
}

/// Of a pair of closed meshes of n vertices each.
double EstimateOf(std::int64_t n, const MatchOptions& options) {
  return double(EstimateMemoryBytes({n, 2 * n}, {n, 2 * n}, 0, options));
}

TEST(MemoryEstimateGrowthTest, PaperGrowsLikeNTimesRootNAtMost) {
  const MatchOptions options = MatchOptions::ForProfile(Profile::kPaper);
  // A factor of 100 in n: at most 1000 in memory, at least 50.
  const double growth =
      EstimateOf(10'000'000, options) / EstimateOf(100'000, options);
  EXPECT_LT(growth, 1000);
  EXPECT_GT(growth, 50);
}

TEST(MemoryEstimateGrowthTest, DecimatedMeshesGrowLikeN) {
  const MatchOptions options;
  const double growth =
      EstimateOf(100'000'000, options) / EstimateOf(1'000'000, options);
  EXPECT_LT(growth, 100);
  EXPECT_GT(growth, 80);
  MatchOptions larger;
  larger.solved_vertices = 16000;
  EXPECT_GT(EstimateOf(100'000, larger), EstimateOf(100'000, options));
  // Where decimation sets in it must not cost more than it saves.
  EXPECT_LT(EstimateOf(4401, options), 1.1 * EstimateOf(4400, options));
}

TEST(MemoryEstimateGrowthTest, HostileSizesDoNotWrapAround) {
  constexpr std::int64_t kHuge = std::numeric_limits<std::int64_t>::max();
  EXPECT_GT(EstimateMemoryBytes({kHuge, kHuge}, {4, 4}, kHuge, {}),
            std::int64_t{1} << 60);
  for (const Relation relation : kRelations) {
    MatchOptions options;
    options.relation = relation;
    options.scale = LengthScale::kSame;
    EXPECT_GT(EstimateMemoryBytes({kHuge, kHuge}, {4, 4}, kHuge, options),
              std::int64_t{1} << 60);
  }
}

TEST(MemoryEstimateGrowthTest, WhatIsFoundOutTakesAsMuchAsAnyOfIt) {
  const MeshSize x = {5000, 10000};
  const MeshSize y = {3000, 6000};
  std::int64_t most = 0;
  MatchOptions options;
  for (const Relation relation : kRelations) {
    options.relation = relation;
    most = std::max(most, EstimateMemoryBytes(x, y, 0, options));
  }
  options.relation = Relation::kAuto;
  EXPECT_EQ(EstimateMemoryBytes(x, y, 0, options), most);
  options.relation = Relation::kWhole;
  EXPECT_LT(EstimateMemoryBytes(x, y, 0, options), most);
}

}  // namespace
}  // namespace isomatch
