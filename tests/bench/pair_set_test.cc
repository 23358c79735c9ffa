#include "tests/bench/pair_set.h"

#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/mesh/mesh_geometry.h"
#include "tests/support/draco_file.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_folder.h"

namespace isomatch::bench {
namespace {

using testing::Contains;
using testing::Each;
using testing::HasSubstr;
using testing::Not;
using testing::SizeIs;

constexpr char kBodies[] = ISOMATCH_TEST_DATA;

/// The mean distance on Y between the images of an edge's two ends.
double MeanMappedEdge(const MeshPair& pair, const VertexMap& y_from_x) {
  double sum = 0;
  for (int corner = 0; corner < 3; ++corner) {
    const int next = (corner + 1) % 3;
    for (Eigen::Index f = 0; f < pair.mesh_x.faces.rows(); ++f) {
      const VertexIndex from = y_from_x[pair.mesh_x.faces(f, corner)];
      const VertexIndex to = y_from_x[pair.mesh_x.faces(f, next)];
      sum += (pair.mesh_y.positions.row(from) - pair.mesh_y.positions.row(to))
                 .norm();
    }
  }
  return sum / (3.0 * pair.mesh_x.num_faces());
}

// Wrong numbers of vertices tear edges apart to the size of the body.
TEST(PairSetTest, TruthsOfTheBodiesAreCompleteAndKeepNeighborsNear) {
  const std::string bodies = kBodies;
  auto names = ReadPairNames(bodies + "/pairs.txt");
  ASSERT_THAT(names, IsOk());
  EXPECT_THAT(*names, SizeIs(18));
  const auto unlike = ReadPairNames(bodies + "/resolution_pairs.txt");
  ASSERT_THAT(unlike, IsOk());
  EXPECT_THAT(*unlike, SizeIs(6));
  names->insert(names->end(), unlike->begin(), unlike->end());
  for (const auto& [x, y] : *names) {
    const auto pair = ReadPair(kBodies, x, y);
    ASSERT_THAT(pair, IsOk()) << x << " " << y;
    for (const VertexMap& truth : {pair->truth.direct, pair->truth.mirrored}) {
      ASSERT_THAT(truth, SizeIs(pair->mesh_x.num_vertices())) << x << " " << y;
      ASSERT_THAT(truth, Each(Not(kNoVertex))) << x << " " << y;
      EXPECT_LT(MeanMappedEdge(*pair, truth), 2 * MeanEdgeLength(pair->mesh_x))
          << x << " " << y;
    }
    EXPECT_NE(pair->truth.direct, pair->truth.mirrored) << x << " " << y;
  }
}

TEST(PairSetTest, WhatIsMissingIsNamed) {
  EXPECT_THAT(ReadPair(kBodies, "none", "r1k_m_sit"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("none.drc'")));
  EXPECT_THAT(ReadPair(kBodies, "r1k_m_sit", "r1k_m_rest"),
              StatusIs(absl::StatusCode::kNotFound,
                       HasSubstr("gt_r1k_m_sit__r1k_m_rest.txt")));
}

TEST(PairSetTest, PackedShapesKeepEveryBit) {
  const TemporaryFolder out;
  ASSERT_THAT(PackShapes(kBodies, out.Path("")), IsOk());
  EXPECT_EQ(out.CountFiles(), 18);
  const std::string bodies = kBodies;
  for (const char* name : {"r1k_m_sit", "full_m_kick"}) {
    const auto mesh = ReadDracoFile(bodies + "/" + name + ".drc");
    ASSERT_THAT(mesh, IsOk());
    const auto packed = ReadDracoFile(out.Path(name) + ".drc");
    ASSERT_THAT(packed, IsOk());
    EXPECT_EQ(packed->positions, mesh->positions) << name;
    EXPECT_EQ(packed->faces, mesh->faces) << name;
  }
}

TEST(PairSetTest, WithoutATemplateThereIsNoMirroredTruth) {
  const TemporaryFolder set;
  const std::string body =
      "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
      "3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
  set.Write("x.off", body);
  set.Write("y.off", body);
  EXPECT_THAT(ReadPair(set.Path(""), "x", "y"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("gt_x__y.txt")));
  set.Write("gt_x__y.txt", "1\n0\n-1\n2\n");
  const auto pair = ReadPair(set.Path(""), "x", "y");
  ASSERT_THAT(pair, IsOk());
  EXPECT_THAT(pair->truth.direct, Contains(kNoVertex));
  EXPECT_THAT(pair->truth.mirrored, SizeIs(0));
}

}  // namespace
}  // namespace isomatch::bench
