#include "core/descriptor/nearby_match.h"

#include <algorithm>
#include <limits>

#include "core/base/status_macros.h"
#include "core/mesh/connected_ball.h"
#include "core/mesh/surface_samples.h"

namespace isomatch {
namespace {

/// Vertices whose descriptors DescriptorMismatch compares.
constexpr std::size_t kProbes = 600;
/// Entries of a descriptor that are compared at a time.
constexpr Eigen::Index kPart = 88;

using Descriptor = Eigen::Ref<const Eigen::VectorXf>;

/// `start` and the squared difference, or, once that exceeds `enough`, only a
/// part of it.
double Unlikeness(const Descriptor& a, const Descriptor& b, double start,
                  double enough) {
  double sum = start;
  for (Eigen::Index i = 0; i < a.size() && sum < enough; i += kPart) {
    const Eigen::Index count = std::min(kPart, a.size() - i);
    sum += (a.segment(i, count) - b.segment(i, count)).squaredNorm();
  }
  return sum;
}

}  // namespace

absl::StatusOr<ShapeDescriptors> DescribeShape(const DescribedSurface& surface,
                                               std::int64_t count,
                                               const ShotBall& ball,
                                               const std::stop_token& stop) {
  ShapeDescriptors described;
  described.vertices = EvenlyByArea(surface.areas, count);
  ISOMATCH_ASSIGN_OR_RETURN(
      described.columns,
      ShotDescriptors(surface, described.vertices, ball, stop));
  described.column_of_vertex.assign(surface.mesh.num_vertices(), -1);
  for (std::size_t i = 0; i < described.vertices.size(); ++i) {
    described.column_of_vertex[described.vertices[i]] = static_cast<int>(i);
  }
  return described;
}

absl::StatusOr<VertexMap> MatchNearby(const ShapeDescriptors& x,
                                      const DescribedShape& y,
                                      const VertexMap& y_from_x,
                                      const NearbyMatchOptions& options,
                                      const std::stop_token& stop) {
  VertexMap matches(y_from_x.size(), kNoVertex);
  const double per_square =
      options.distance_weight / (options.reach * options.reach);
  const auto most_alike = [&](std::int64_t i, ConnectedBall* around) {
    VertexIndex best = kNoVertex;
    double least = std::numeric_limits<double>::infinity();
    const VertexIndex image = y_from_x[x.vertices[i]];
    for (const auto& [v, distance] : around->Around(image, options.reach)) {
      const int column = y.descriptors.column_of_vertex[v];
      if (column < 0) continue;
      const double unlikeness =
          Unlikeness(x.columns.col(i), y.descriptors.columns.col(column),
                     per_square * distance * distance, least);
      if (unlikeness >= least) continue;
      least = unlikeness;
      best = v;
    }
    return best;
  };
  const std::int64_t count =
      (static_cast<std::int64_t>(x.vertices.size()) + options.every - 1) /
      options.every;
  ISOMATCH_RETURN_IF_ERROR(
      ParallelForWithBall(y.surface.mesh, y.surface.stars, count, stop,
                          [&](std::int64_t i, ConnectedBall* around) {
                            matches[x.vertices[i * options.every]] =
                                most_alike(i * options.every, around);
                          }));
  return matches;
}

absl::StatusOr<double> DescriptorMismatch(const ShapeDescriptors& x,
                                          const DescribedSurface& surface_y,
                                          const VertexMap& y_from_x,
                                          const ShotBall& ball,
                                          const std::stop_token& stop) {
  const std::size_t probes = std::min(kProbes, x.vertices.size());
  std::vector<Eigen::Index> columns;
  std::vector<VertexIndex> images;
  for (std::size_t i = 0; i < probes; ++i) {
    const std::size_t column = i * x.vertices.size() / probes;
    columns.push_back(static_cast<Eigen::Index>(column));
    images.push_back(y_from_x[x.vertices[column]]);
  }
  ISOMATCH_ASSIGN_OR_RETURN(const PointColumns found,
                            ShotDescriptors(surface_y, images, ball, stop));
  double sum = 0;
  for (std::size_t i = 0; i < probes; ++i) {
    sum += (x.columns.col(columns[i]) - found.col(static_cast<int>(i)))
               .squaredNorm();
  }
  return sum / static_cast<double>(probes);
}

}  // namespace isomatch
