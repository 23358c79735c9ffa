#include "core/descriptor/nearby_match.h"

#include <algorithm>
#include <utility>

#include <Eigen/QR>

#include "core/base/lanes.h"
#include "core/base/parallel.h"
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
static_assert(kShotSize % kPart == 0 && kPart % kLanes == 0);
/// Descriptors a side by which main directions are found, rows of what is told
/// by them, and columns that a task projects.
constexpr Eigen::Index kSamples = 200;
constexpr Eigen::Index kFew = kMainDirections + 1;
constexpr Eigen::Index kBlock = 256;
/// How far from their center the images of a cluster lie at most, of the reach.
constexpr double kClusterReach = 0.25;
/// What no descriptors are, and the rounding of products of what they are.
constexpr float kUnlike = 100;
constexpr float kRounding = 1e-5F;

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

/// Where the least of `count` values is, not 0 of them and filled up to a
/// multiple of kLanes by greater ones.
std::int64_t PlaceOfLeast(const float* values, std::int64_t count) {
  Lanes least = LoadLanes(values);
  LaneBits places = {};
  for (int i = kLanes; i < count; i += kLanes) {
    const Lanes here = LoadLanes(values + i);
    places = here < least ? LaneBits{} + i : places;
    least = MinLanes(least, here);
  }
  int lane = 0;
  for (int i = 1; i < kLanes; ++i) {
    if (least[i] < least[lane]) lane = i;
  }
  return places[lane] + lane;
}

/// Of `count` even ones among the columns, the i-th.
auto EvenColumn(const PointColumns& columns, Eigen::Index i,
                Eigen::Index count) {
  return columns.col(i * columns.cols() / count);
}

Eigen::MatrixXf OrthonormalBasis(const Eigen::MatrixXf& columns) {
  return Eigen::HouseholderQR<Eigen::MatrixXf>(columns).householderQ() *
         Eigen::MatrixXf::Identity(columns.rows(), columns.cols());
}

/// Orthonormal columns that span most of what descriptors differ by: some of
/// them after a step of subspace iteration.
Eigen::MatrixXf MainDirections(const PointColumns& x, const PointColumns& y) {
  PointColumns samples(kShotSize, 2 * kSamples);
  for (Eigen::Index i = 0; i < kSamples; ++i) {
    samples.col(2 * i) = EvenColumn(x, i, kSamples);
    samples.col(2 * i + 1) = EvenColumn(y, i, kSamples);
  }
  PointColumns start(kShotSize, kMainDirections);
  for (Eigen::Index i = 0; i < kMainDirections; ++i) {
    start.col(i) = EvenColumn(samples, i, kMainDirections);
  }
  const Eigen::MatrixXf along = samples.transpose() * OrthonormalBasis(start);
  return OrthonormalBasis(samples * along);
}

absl::StatusOr<PointColumns> Projected(const PointColumns& columns,
                                       const Eigen::MatrixXf& directions,
                                       const std::stop_token& stop) {
  PointColumns few(kFew, columns.cols());
  const Eigen::Index blocks = (columns.cols() + kBlock - 1) / kBlock;
  ISOMATCH_RETURN_IF_ERROR(ParallelFor(blocks, stop, [&](std::int64_t block) {
    const Eigen::Index begin = block * kBlock;
    const Eigen::Index size = std::min(kBlock, columns.cols() - begin);
    const auto whole = columns.middleCols(begin, size);
    const Eigen::MatrixXf along = directions.transpose() * whole;
    few.block(0, begin, kMainDirections, size) = along;
    few.block(kMainDirections, begin, 1, size) =
        (whole.colwise().squaredNorm() - along.colwise().squaredNorm())
            .cwiseMax(0)
            .cwiseSqrt();
  }));
  return few;
}

/// Vertices of X whose images lie together, so that they share a ball of Y.
struct ImageCluster {
  VertexIndex center = 0;
  double radius = 0;                  ///< of the images, around the center
  std::vector<Eigen::Index> columns;  ///< of the descriptors of X
};

/// Images of one map, and what is near them.
class NearbySearch {
 public:
  /// References must outlive it.
  NearbySearch(const DescribedPair& pair, const VertexMap& y_from_x,
               const NearbyMatchOptions& options)
      : pair_(pair),
        y_from_x_(y_from_x),
        options_(options),
        per_square_(static_cast<float>(options.distance_weight /
                                       (options.reach * options.reach))),
        positions_(BallPositions(pair.y.surface.mesh.positions)) {}

  /// BallPositions of Y.
  const Eigen::Matrix4Xf& positions() const { return positions_; }

  std::vector<ImageCluster> Clusters() const;

  /// Thread-safe for different clusters.
  void Match(const ImageCluster& cluster, ConnectedBall* around,
             VertexMap* matches) const;

 private:
  /// A column for a vertex of X times one for a vertex of Y is the least that
  /// the two are unlike: directions, position, and two rows for squares.
  static constexpr Eigen::Index kRows = kFew + 5;

  VertexIndex Image(Eigen::Index column) const {
    return y_from_x_[pair_.x.vertices[column]];
  }
  Eigen::Vector3f FromCenter(VertexIndex v, VertexIndex center) const {
    return (positions_.col(v) - positions_.col(center)).head<3>();
  }
  PointColumns Queries(const ImageCluster& cluster) const;
  PointColumns Places(const std::vector<VertexIndex>& near,
                      VertexIndex center) const;
  VertexIndex MostAlike(Eigen::Index column,
                        const std::vector<VertexIndex>& near,
                        const float* bounds) const;

  const DescribedPair& pair_;
  const VertexMap& y_from_x_;
  const NearbyMatchOptions& options_;
  const float per_square_;  ///< what a squared distance counts
  const Eigen::Matrix4Xf positions_;
};

std::vector<ImageCluster> NearbySearch::Clusters() const {
  const std::int64_t count =
      (std::ssize(pair_.x.vertices) + options_.every - 1) / options_.every;
  const SortedBuckets<Eigen::Index> by_image(
      count, pair_.y.surface.mesh.num_vertices(),
      [&](std::int64_t i) { return Image(i * options_.every); },
      [&](std::int64_t i) { return i * options_.every; });
  ConnectedBall ball(positions_, pair_.y.surface.stars);
  std::vector<char> taken(by_image.count());
  std::vector<ImageCluster> clusters;
  for (VertexIndex center = 0; center < by_image.count(); ++center) {
    if (taken[center] || by_image[center].empty()) continue;
    ImageCluster cluster{center, 0, {}};
    for (const auto& [v, distance] :
         ball.Around(center, kClusterReach * options_.reach)) {
      if (taken[v] || by_image[v].empty()) continue;
      taken[v] = 1;
      cluster.radius = std::max(cluster.radius, double{distance});
      cluster.columns.insert(cluster.columns.end(), by_image[v].begin(),
                             by_image[v].end());
    }
    clusters.push_back(std::move(cluster));
  }
  return clusters;
}

PointColumns NearbySearch::Queries(const ImageCluster& cluster) const {
  PointColumns queries(kRows, std::ssize(cluster.columns));
  for (Eigen::Index i = 0; i < queries.cols(); ++i) {
    const auto few = pair_.few_x.col(cluster.columns[i]).head<kFew>();
    const Eigen::Vector3f place =
        FromCenter(Image(cluster.columns[i]), cluster.center);
    queries.col(i).head<kFew>() = -2 * few;
    queries.col(i).segment<3>(kFew) = -2 * per_square_ * place;
    queries.col(i).tail<2>()
        << few.squaredNorm() + per_square_ * place.squaredNorm(),
        1;
  }
  return queries;
}

/// A multiple of kLanes, those beyond `near` unlike everything.
PointColumns NearbySearch::Places(const std::vector<VertexIndex>& near,
                                  VertexIndex center) const {
  const std::int64_t lanes = (std::ssize(near) + kLanes - 1) / kLanes;
  PointColumns places(kRows, lanes * kLanes);
  for (Eigen::Index i = 0; i < std::ssize(near); ++i) {
    const auto few =
        pair_.few_y.col(pair_.y.descriptors.column_of_vertex[near[i]])
            .head<kFew>();
    const Eigen::Vector3f place = FromCenter(near[i], center);
    places.col(i).head<kFew>() = few;
    places.col(i).segment<3>(kFew) = place;
    places.col(i).tail<2>() << 1,
        few.squaredNorm() + per_square_ * place.squaredNorm();
  }
  for (Eigen::Index i = std::ssize(near); i < places.cols(); ++i) {
    places.col(i).setZero();
    places(kRows - 1, i) = kUnlike;
  }
  return places;
}

VertexIndex NearbySearch::MostAlike(Eigen::Index column,
                                    const std::vector<VertexIndex>& near,
                                    const float* bounds) const {
  const Eigen::Vector4f image = positions_.col(Image(column));
  const auto enough = static_cast<float>(options_.reach * options_.reach);
  VertexIndex best = kNoVertex;
  float least = kUnlike - kRounding;
  const auto consider = [&](VertexIndex v) {
    const float squared = (positions_.col(v) - image).squaredNorm();
    if (squared >= enough) return;
    const Eigen::Index other = pair_.y.descriptors.column_of_vertex[v];
    const float unlikeness =
        Unlikeness(pair_.x.columns.col(column).data(),
                   pair_.y.descriptors.columns.col(other).data(),
                   per_square_ * squared, least);
    if (unlikeness >= least) return;
    least = unlikeness;
    best = v;
  };
  const std::int64_t size = std::ssize(near);
  consider(near[PlaceOfLeast(bounds, size)]);
  for (std::int64_t i = 0; i < size; i += kLanes) {
    if (!AnyLane(LoadLanes(bounds + i) < AllLanes(least + kRounding))) continue;
    for (std::int64_t j = i; j < i + kLanes; ++j) {
      if (bounds[j] < least + kRounding) consider(near[j]);
    }
  }
  return best;
}

void NearbySearch::Match(const ImageCluster& cluster, ConnectedBall* around,
                         VertexMap* matches) const {
  std::vector<VertexIndex> near;
  for (const auto& [v, distance] :
       around->Around(cluster.center, options_.reach + cluster.radius)) {
    if (pair_.y.descriptors.column_of_vertex[v] >= 0) near.push_back(v);
  }
  if (near.empty()) return;
  const PointColumns bounds =
      Places(near, cluster.center).transpose() * Queries(cluster);
  for (Eigen::Index i = 0; i < bounds.cols(); ++i) {
    const Eigen::Index column = cluster.columns[i];
    (*matches)[pair_.x.vertices[column]] =
        MostAlike(column, near, bounds.col(i).data());
  }
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

absl::StatusOr<DescribedPair> PairDescriptors(const ShapeDescriptors& x,
                                              const DescribedShape& y,
                                              const std::stop_token& stop) {
  const Eigen::MatrixXf directions =
      MainDirections(x.columns, y.descriptors.columns);
  DescribedPair pair = {x, y, {}, {}};
  ISOMATCH_ASSIGN_OR_RETURN(pair.few_x, Projected(x.columns, directions, stop));
  ISOMATCH_ASSIGN_OR_RETURN(pair.few_y,
                            Projected(y.descriptors.columns, directions, stop));
  return pair;
}

absl::StatusOr<VertexMap> MatchNearby(const DescribedPair& pair,
                                      const VertexMap& y_from_x,
                                      const NearbyMatchOptions& options,
                                      const std::stop_token& stop) {
  VertexMap matches(y_from_x.size(), kNoVertex);
  const NearbySearch search(pair, y_from_x, options);
  const std::vector<ImageCluster> clusters = search.Clusters();
  ISOMATCH_RETURN_IF_ERROR(ParallelForWithBall(
      search.positions(), pair.y.surface.stars, std::ssize(clusters), stop,
      [&](std::int64_t i, ConnectedBall* around) {
        search.Match(clusters[i], around, &matches);
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
