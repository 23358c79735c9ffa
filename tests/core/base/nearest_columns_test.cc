#include "core/base/nearest_columns.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/base/random_stream.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

PointColumns RandomPoints(int rows, int cols, int seed) {
  RandomStream random(seed, 0);
  PointColumns points(rows, cols);
  for (Eigen::Index i = 0; i < points.size(); ++i) {
    points.data()[i] = static_cast<float>(random.Unit());
  }
  return points;
}

TEST(NearestColumnsTest, AgreesWithBruteForceAcrossBlocks) {
  const PointColumns queries = RandomPoints(7, 301, /*seed=*/1);
  const PointColumns points = RandomPoints(7, 1203, /*seed=*/2);
  const auto nearest = NearestColumns(queries, points, {});
  ASSERT_THAT(nearest, IsOk());
  for (Eigen::Index q = 0; q < queries.cols(); ++q) {
    Eigen::Index expected;
    (points.colwise() - queries.col(q))
        .colwise()
        .squaredNorm()
        .minCoeff(&expected);
    EXPECT_EQ((*nearest)[q], expected) << "query " << q;
  }
}

/// Points of a curve in order, around `middle`: most are passed over.
PointColumns OnCurve(int count, double shift, double middle) {
  PointColumns points(6, count);
  for (int i = 0; i < count; ++i) {
    const double t = 20 * (i + shift) / count;
    for (int d = 0; d < 6; ++d) {
      points(d, i) = static_cast<float>(middle + std::sin(t * (1 + 0.3 * d)));
    }
  }
  return points;
}

TEST(NearestColumnsTest, PassesOverOnlyWhatIsFartherAway) {
  for (const double middle : {0.0, 0.5, 3.0}) {
    PointColumns queries = OnCurve(700, 0.3, middle);
    queries.col(5).setZero();
    const PointColumns points = OnCurve(1001, 0, middle);
    const auto nearest = NearestColumns(queries, points, {});
    ASSERT_THAT(nearest, IsOk());
    const Eigen::MatrixXd exact = points.cast<double>();
    for (Eigen::Index q = 0; q < queries.cols(); ++q) {
      const Eigen::VectorXd query = queries.col(q).cast<double>();
      const double least =
          (exact.colwise() - query).colwise().squaredNorm().minCoeff();
      // Neighbors on the curve are 5e-3 apart, squared.
      EXPECT_LT((exact.col((*nearest)[q]) - query).squaredNorm(),
                least + 2e-6 * (1 + query.squaredNorm()))
          << "query " << q << " around " << middle;
    }
  }
}

TEST(NearestColumnsTest, OfEqualPointsFarApartTheFirstIsTaken) {
  const PointColumns curve = OnCurve(400, 0, 0);
  PointColumns points(6, 800);
  points << curve, curve;
  const auto nearest = NearestColumns(curve, points, {});
  ASSERT_THAT(nearest, IsOk());
  for (VertexIndex q = 0; q < 400; ++q) EXPECT_EQ((*nearest)[q], q);
}

TEST(NearestColumnsTest, TiesGoToTheSmallestIndex) {
  PointColumns points = PointColumns::Ones(3, 1100);
  const auto nearest = NearestColumns(points.leftCols(2), points, {});
  ASSERT_THAT(nearest, IsOk());
  EXPECT_THAT(*nearest, testing::Each(0));
}

TEST(NearestColumnsTest, StopsWhenAsked) {
  std::stop_source stop;
  stop.request_stop();
  const PointColumns points = RandomPoints(3, 50, /*seed=*/3);
  EXPECT_THAT(NearestColumns(points, points, stop.get_token()),
              StatusIs(absl::StatusCode::kCancelled, testing::_));
}

}  // namespace
}  // namespace isomatch
