#include "core/descriptor/nearby_match.h"

#include <algorithm>
#include <limits>

#include "core/base/lanes.h"
#include "core/base/sorted_buckets.h"
#include "core/base/status_macros.h"
#include "core/mesh/connected_ball.h"
#include "core/mesh/surface_samples.h"

namespace isomatch {
namespace {

/// Vertices whose descriptors DescriptorMismatch compares.
constexpr std::size_t kProbes = 600;
/// Entries of a descriptor that are compared at a time.
constexpr int kPart = 88;
constexpr int kHistograms = kShotSize / kShotCosines;
static_assert(kShotSize % kPart == 0 && kPart % kLanes == 0 &&
              kHistograms % kLanes == 0);

/// REQUIRES: count is a multiple of kLanes.
float SquaredDifference(const float* a, const float* b, int count) {
  Lanes sum = {};
  for (int i = 0; i < count; i += kLanes) {
    const Lanes difference = LoadLanes(a + i) - LoadLanes(b + i);
    sum += difference * difference;
  }
  return SumOfLanes(sum);
}

/// `start` and the squared difference of two descriptors, or, once that exceeds
/// `enough`, only a part of it.
float Unlikeness(const float* a, const float* b, float start, float enough) {
  float sum = start;
  for (int i = 0; i < kShotSize && sum < enough; i += kPart) {
    sum += SquaredDifference(a + i, b + i, kPart);
  }
  return sum;
}

/// Lengths of the histograms that make up each descriptor, by which most pairs
/// are known to be unlike: lengths differ by no more than what they are of.
PointColumns HistogramLengths(const PointColumns& columns) {
  PointColumns lengths(kHistograms, columns.cols());
  for (Eigen::Index i = 0; i < columns.cols(); ++i) {
    for (Eigen::Index h = 0; h < kHistograms; ++h) {
      lengths(h, i) =
          columns.col(i).segment<kShotCosines>(h * kShotCosines).norm();
    }
  }
  return lengths;
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
  const PointColumns lengths_x = HistogramLengths(x.columns);
  const PointColumns lengths_y = HistogramLengths(y.descriptors.columns);
  VertexMap matches(y_from_x.size(), kNoVertex);
  const auto per_square = static_cast<float>(options.distance_weight /
                                             (options.reach * options.reach));
  const auto most_alike = [&](std::int64_t i, ConnectedBall* around) {
    const float* const own = x.columns.col(i).data();
    const float* const own_lengths = lengths_x.col(i).data();
    VertexIndex best = kNoVertex;
    float least = std::numeric_limits<float>::infinity();
    const VertexIndex image = y_from_x[x.vertices[i]];
    for (const auto& [v, distance] : around->Around(image, options.reach)) {
      const int column = y.descriptors.column_of_vertex[v];
      if (column < 0) continue;
      const float start = per_square * distance * distance;
      const float* const lengths = lengths_y.col(column).data();
      if (start + SquaredDifference(own_lengths, lengths, kHistograms) >=
          least) {
        continue;
      }
      const float unlikeness = Unlikeness(
          own, y.descriptors.columns.col(column).data(), start, least);
      if (unlikeness >= least) continue;
      least = unlikeness;
      best = v;
    }
    return best;
  };
  const std::int64_t count =
      (static_cast<std::int64_t>(x.vertices.size()) + options.every - 1) /
      options.every;
  // Those of one image follow each other, so that they share a ball.
  const SortedBuckets<std::int64_t> by_image(
      count, y.surface.mesh.num_vertices(),
      [&](std::int64_t i) { return y_from_x[x.vertices[i * options.every]]; },
      [&](std::int64_t i) { return i * options.every; });
  ISOMATCH_RETURN_IF_ERROR(ParallelForWithBall(
      y.surface.mesh, y.surface.stars, count, stop,
      [&](std::int64_t i, ConnectedBall* around) {
        const std::int64_t column = by_image.items()[i];
        matches[x.vertices[column]] = most_alike(column, around);
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
