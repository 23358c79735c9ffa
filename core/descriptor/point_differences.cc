#include "core/descriptor/point_differences.h"

#include <algorithm>
#include <utility>

#include "core/base/status_macros.h"

namespace isomatch {
namespace {

/// Share of a ball around a point of the rim itself that is trusted in.
constexpr float kLeastTrust = 0.15f;

}  // namespace

absl::StatusOr<PointDescriptors> DescribePoints(
    const DescribedSurface& surface, absl::Span<const VertexIndex> vertices,
    absl::Span<const float> rim_distances, absl::Span<const ShotBall> balls,
    const std::stop_token& stop) {
  PointDescriptors points;
  points.trust.resize(static_cast<Eigen::Index>(balls.size()),
                      static_cast<Eigen::Index>(vertices.size()));
  for (std::size_t r = 0; r < balls.size(); ++r) {
    ISOMATCH_ASSIGN_OR_RETURN(
        PointColumns columns,
        ShotDescriptors(surface, vertices, balls[r], stop));
    points.columns.push_back(std::move(columns));
    for (std::size_t i = 0; i < vertices.size(); ++i) {
      const float part = std::clamp(
          rim_distances[vertices[i]] / static_cast<float>(balls[r].radius),
          kLeastTrust, 1.0f);
      points.trust(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(i)) =
          part * part;
    }
  }
  return points;
}

Eigen::MatrixXf PointDifferences(const PointDescriptors& x,
                                 const PointDescriptors& y) {
  Eigen::MatrixXf sum = Eigen::MatrixXf::Zero(y.trust.cols(), x.trust.cols());
  for (std::size_t r = 0; r < x.columns.size(); ++r) {
    const Eigen::MatrixXf likeness = y.columns[r].transpose() * x.columns[r];
    sum.array() += (2 - 2 * likeness.array()).rowwise() *
                   x.trust.row(static_cast<Eigen::Index>(r)).array();
  }
  return (sum.array().rowwise() / x.trust.colwise().sum().array()).matrix();
}

}  // namespace isomatch
