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
  for (const float c : ConfidenceOf({none, none, none}, stars)) {
    EXPECT_NEAR(c, std::exp(-0.2), 1e-6);
  }
  for (const ErrorSigns& signs :
       {ErrorSigns{sign, none, none}, ErrorSigns{none, sign, none},
        ErrorSigns{none, none, sign}}) {
    const std::vector<float> confidence = ConfidenceOf(signs, stars);
    EXPECT_LT(confidence[7], 0.95 * std::exp(-0.2));
    EXPECT_GE(confidence[7], 0);
    // Far from there nothing changes.
    Eigen::Index far;
    (mesh.positions.rowwise() - mesh.positions.row(7))
        .rowwise()
        .norm()
        .maxCoeff(&far);
    EXPECT_NEAR(confidence[far], std::exp(-0.2), 1e-6);
  }
}

TEST(ConfidenceTest, WorksWithoutAlignment) {
  const TriangleMesh mesh = FiveArms(1);
  const std::vector<float> distortions(mesh.num_vertices(), 0.5f);
  const std::vector<float> confidence =
      ConfidenceOf({distortions, {}, {}}, VertexStars(mesh));
  for (const float c : confidence) EXPECT_LT(c, 0.01);
}

}  // namespace
}  // namespace isomatch
