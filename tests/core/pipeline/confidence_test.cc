#include "core/pipeline/confidence.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/support/shapes.h"

namespace isomatch {
namespace {

TEST(ConfidenceTest, FallsWithEverySignAroundWhereItShows) {
  const TriangleMesh mesh = FiveArms(4);
  const VertexStars stars(mesh);
  const std::vector<float> none(mesh.num_vertices(), 0);
  std::vector<float> sign = none;
  sign[7] = 5;
  for (const float c : ConfidenceOf({none, none, none, none}, stars)) {
    EXPECT_NEAR(c, std::exp(-0.1), 1e-6);
  }
  for (const ErrorSigns& signs :
       {ErrorSigns{sign, none, none, none}, ErrorSigns{none, sign, none, none},
        ErrorSigns{none, none, sign, none},
        ErrorSigns{none, none, none, sign}}) {
    const std::vector<float> confidence = ConfidenceOf(signs, stars);
    EXPECT_LT(confidence[7], 0.95 * std::exp(-0.1));
    EXPECT_GE(confidence[7], 0);
    // Far from there nothing changes.
    Eigen::Index far;
    (mesh.positions.rowwise() - mesh.positions.row(7))
        .rowwise()
        .norm()
        .maxCoeff(&far);
    EXPECT_NEAR(confidence[far], std::exp(-0.1), 1e-6);
  }
}

TEST(ConfidenceTest, TakesWhatIsNotKnownFromAround) {
  const TriangleMesh mesh = FiveArms(2);
  const VertexStars stars(mesh);
  const std::vector<float> none(mesh.num_vertices(), 0);
  const std::vector<float> same(mesh.num_vertices(), 0.3f);
  std::vector<float> gaps = same;
  for (std::size_t v = 0; v < gaps.size(); v += 2) gaps[v] = -1;
  const std::vector<float> unknown(mesh.num_vertices(), -1);
  const std::vector<float> full = ConfidenceOf({none, {}, {}, same}, stars);
  const std::vector<float> filled = ConfidenceOf({none, {}, {}, gaps}, stars);
  const std::vector<float> absent =
      ConfidenceOf({none, {}, {}, unknown}, stars);
  for (std::size_t v = 0; v < none.size(); ++v) {
    EXPECT_NEAR(filled[v], full[v], 1e-6);
    EXPECT_NEAR(absent[v], std::exp(-0.1), 1e-6);
  }
}

TEST(ConfidenceTest, WorksWithoutAlignment) {
  const TriangleMesh mesh = FiveArms(1);
  const std::vector<float> distortions(mesh.num_vertices(), 0.5f);
  const std::vector<float> confidence =
      ConfidenceOf({distortions, {}, {}, {}}, VertexStars(mesh));
  for (const float c : confidence) EXPECT_LT(c, 0.01);
}

}  // namespace
}  // namespace isomatch
