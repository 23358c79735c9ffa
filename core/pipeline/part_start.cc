#include "core/pipeline/part_start.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

#include "core/base/parallel.h"
#include "core/base/status_macros.h"
#include "core/descriptor/point_differences.h"
#include "core/geodesic/distance_field_solver.h"
#include "core/geodesic/rim_distance.h"
#include "core/matching/alike_seeds.h"
#include "core/matching/closeness.h"
#include "core/matching/first_stage.h"
#include "core/matching/orientation.h"
#include "core/mesh/mesh_geometry.h"
#include "core/pipeline/landmarks.h"
#include "core/pipeline/stage_plan.h"

namespace isomatch {
namespace {

/// Of the smaller balls by which points are compared, sqrt(area of Y); of the
/// larger ones twice that. They hold at least so many edges; an edge of X
/// counts with a part's usual scale, which is not known yet.
constexpr double kLeastRadius = 0.08;
constexpr double kLeastEdges = 3;
constexpr double kUsualScale = 0.7;
/// Where the points of X lie nearer to its rim on average than this part of the
/// smaller radius, the rim cuts nearly all balls, and larger ones tell more.
constexpr double kMostlyCut = 0.75;
constexpr double kWider = 1.5;

/// Scales that are tried: from kLeastScale on, each kScaleStep times the one
/// before. A part is no larger than the whole, but for what it is stretched.
constexpr double kLeastScale = 0.25;
constexpr double kMostScale = 1.3;
constexpr double kScaleStep = 1.12;
/// Scales nearer than this to each other are one.
constexpr double kSameScale = 1.05;
/// Peaks of the support that are looked at, and how far beside the best one
/// the right one may lie, on the shoulder of a false peak.
constexpr std::size_t kPeaks = 3;
constexpr double kBesideThePeak = 1.4;
/// Times that a scale is corrected by the ratio of the distances.
constexpr int kCorrections = 3;
constexpr double kExactRatio = 1.004;
/// Steps from the best scale on in both directions, until so many in a row are
/// worse than the best.
constexpr double kFineStep = 1.1;
constexpr int kPatience = 2;
/// The next scale is farther than this from the best one, among those at which
/// seeds have this part of the most support.
constexpr double kOtherScale = 1.2;
constexpr double kMuchSupport = 0.7;

/// Changes that fields between points of a pool are not followed to: what they
/// add up to is far less than parts that correspond differ by.
constexpr float kPoolChange = 3e-3f;

/// How many seeds are looked for, among how many points of X.
struct Effort {
  int points_x;
  int tries;
  int max_seeds;
};
constexpr Effort kToScan = {200, 8000, 100};
constexpr Effort kToCompare = {kPartPoolSize, 20000, 100};
constexpr Effort kToMatch = {kPartPoolSize, 40000, 300};
constexpr Effort kToOverlap = {kPartPoolSize, 40000, 120};

double Apart(double a, double b) { return std::abs(std::log(a / b)); }

/// One shape in its own unit.
struct Measured {
  std::vector<VertexIndex> vertices;  ///< of the pool
  PointFrames frames;
  std::vector<float> rim_distances;
  Eigen::MatrixXf distances;  ///< P x P, between the pool's points
};

absl::Status Measure(const PreparedMesh& shape, const std::stop_token& stop,
                     Measured* measured) {
  const WorkingMesh& solved = shape.solved();
  const DistanceFieldSolver solver(solved.mesh, stop);
  const std::vector<VertexIndex>& vertices = measured->vertices;
  measured->frames = {solved.mesh.positions(vertices, Eigen::all),
                      solved.normals(vertices, Eigen::all),
                      shape.curvature(vertices)};
  measured->rim_distances = RimDistances(solved.mesh, solver);
  ISOMATCH_ASSIGN_OR_RETURN(
      measured->distances, DistancesAmong(solver, vertices, stop, kPoolChange));
  return absl::OkStatus();
}

/// Puts the `count` points that are farthest from the rim before the others;
/// among both the order stays.
void PutInnerFirst(std::size_t count, Measured* measured) {
  if (measured->vertices.size() <= count) return;
  std::vector<int> order(measured->vertices.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return measured->rim_distances[measured->vertices[a]] >
           measured->rim_distances[measured->vertices[b]];
  });
  const auto outer = order.begin() + static_cast<std::ptrdiff_t>(count);
  std::sort(order.begin(), outer);
  std::sort(outer, order.end());
  const std::vector<VertexIndex> before = measured->vertices;
  for (std::size_t i = 0; i < order.size(); ++i) {
    measured->vertices[i] = before[order[i]];
  }
  PointFrames& frames = measured->frames;
  frames.positions = frames.positions(order, Eigen::all).eval();
  frames.normals = frames.normals(order, Eigen::all).eval();
  frames.curvatures = frames.curvatures(order).eval();
  measured->distances = measured->distances(order, order).eval();
}

/// What is found at one scale.
struct Start {
  double scale = 1;
  Eigen::MatrixXf differences;
  SupportedSeeds found;
};

/// Looks for seeds between two shapes at any scale.
class StartSearch {
 public:
  StartSearch(const PreparedMesh& x, const PreparedMesh& y,
              const MatchOptions& options, const SearchControl& control)
      : x_(x),
        y_(y),
        options_(options),
        control_(control),
        closeness_y_(y.hash.basis, options.kernel_width) {}

  absl::Status Prepare(absl::Span<const Landmark> landmarks) {
    std::vector<std::string> known_warnings;
    ISOMATCH_ASSIGN_OR_RETURN(
        const std::vector<WorkingLandmark> taken,
        TakeLandmarks(landmarks, x_, y_, &known_warnings));
    of_x_.vertices =
        PoolVertices(x_.hash, kPartPoolSize, VerticesOf(taken, kX));
    of_y_.vertices =
        PoolVertices(y_.hash, options_.pool_size, VerticesOf(taken, kY));
    ISOMATCH_RETURN_IF_ERROR(
        RunBoth([&] { return Measure(x_, control_.stop, &of_x_); },
                [&] { return Measure(y_, control_.stop, &of_y_); }));
    const double edge =
        std::max(MeanEdgeLength(y_.solved().mesh),
                 kUsualScale * MeanEdgeLength(x_.solved().mesh));
    const double radius = std::max(kLeastRadius, kLeastEdges * edge);
    return DescribeY(radius);
  }

  /// Of a part in the scale that is found: where the rim cuts nearly all balls,
  /// has its inner points make the seeds, and takes larger balls.
  absl::Status AvoidRim(double scale) {
    double sum = 0;
    for (const VertexIndex v : of_x_.vertices) sum += of_x_.rim_distances[v];
    const double mean =
        scale * sum / static_cast<double>(of_x_.vertices.size());
    is_mostly_rim_ = mean < kMostlyCut * radii_[0];
    if (!is_mostly_rim_) return absl::OkStatus();
    PutInnerFirst(AlikeSeedOptions().points_x, &of_x_);
    return DescribeY(kWider * radii_[0]);
  }

  absl::StatusOr<Start> At(double scale, const Effort& effort) const {
    const std::stop_token& stop = control_.stop;
    // All of the pool has to be described, with the landmarks at its end.
    const std::size_t points =
        effort.points_x < kPartPoolSize
            ? std::min<std::size_t>(effort.points_x, of_x_.vertices.size())
            : of_x_.vertices.size();
    ISOMATCH_ASSIGN_OR_RETURN(
        const PointDescriptors described_x,
        DescribePoints(SurfaceOf(x_),
                       absl::MakeConstSpan(of_x_.vertices).first(points),
                       of_x_.rim_distances, Balls(1 / scale), stop));
    Start start = {scale, PointDifferences(described_x, described_y_), {}};
    const auto size = static_cast<Eigen::Index>(points);
    const Eigen::MatrixXf distances_x =
        static_cast<float>(scale) * of_x_.distances.topLeftCorner(size, size);
    AlikeSeedOptions seeds;
    seeds.max_seeds = effort.max_seeds;
    seeds.tries = effort.tries;
    seeds.oriented = oriented();
    seeds.random_seed = options_.random_seed;
    ISOMATCH_ASSIGN_OR_RETURN(
        start.found, AlikeSeeds(start.differences, {distances_x, of_x_.frames},
                                {of_y_.distances, of_y_.frames}, seeds, stop));
    return start;
  }

  /// The scale at which a map grows best, or with MatchOptions::next_scale the
  /// next one.
  absl::StatusOr<double> Scale() {
    ISOMATCH_ASSIGN_OR_RETURN(
        pool_y_,
        PointPool::Create(closeness_y_, of_y_.vertices, control_.stop));
    ISOMATCH_RETURN_IF_ERROR(pool_y_.ListNearest(control_.stop));
    ISOMATCH_ASSIGN_OR_RETURN(const std::vector<double> scales, Scales());
    for (const double scale : scales) {
      ISOMATCH_RETURN_IF_ERROR(GrowAt(scale));
    }
    if (!std::isfinite(Best().badness)) {
      if (options_.next_scale) return NoOtherScale();
      return 1.0;
    }
    const double middle = Best().scale;
    ISOMATCH_RETURN_IF_ERROR(GrowInSteps(middle, kFineStep));
    ISOMATCH_RETURN_IF_ERROR(GrowInSteps(middle, 1 / kFineStep));
    return options_.next_scale ? NextScale() : Best().scale;
  }

  PartStart Result(Start start) && {
    of_x_.distances *= static_cast<float>(start.scale);
    return {start.scale,
            is_mostly_rim_,
            {std::move(of_x_.vertices), std::move(of_y_.vertices)},
            {std::move(of_x_.distances), std::move(of_y_.distances)},
            std::move(start.differences),
            std::move(start.found.seeds)};
  }

 private:
  /// Of a shape whose lengths are as many times Y's.
  std::array<ShotBall, 2> Balls(double unit) const {
    std::array<ShotBall, 2> balls = {ShotBall{radii_[0] * unit},
                                     ShotBall{radii_[1] * unit}};
    if (oriented()) {
      for (ShotBall& ball : balls) ball.least_cosine = kFacing;
    }
    return balls;
  }

  bool oriented() const { return x_.solved().oriented && y_.solved().oriented; }

  /// By balls of this radius and twice that.
  absl::Status DescribeY(double radius) {
    radii_ = {radius, 2 * radius};
    ISOMATCH_ASSIGN_OR_RETURN(
        described_y_,
        DescribePoints(SurfaceOf(y_), of_y_.vertices, of_y_.rim_distances,
                       Balls(1), control_.stop));
    return absl::OkStatus();
  }

  /// What was found at a scale, but for what it was found by.
  struct Tried {
    double scale;
    double support;
    double ratio;
  };

  /// How bad a map is that was grown at a scale.
  struct Grown {
    double scale;
    double badness;
  };

  /// How many maps are to be grown turns out on the way: each is a tenth of
  /// what is left to tell.
  absl::Status GrowAt(double scale) {
    ISOMATCH_ASSIGN_OR_RETURN(const double badness, BadnessAt(scale));
    grown_.push_back({scale, badness});
    control_.progress(0.95 - 0.45 * std::pow(0.9, grown_.size()));
    return absl::OkStatus();
  }

  /// Until so many in a row are worse than the best.
  absl::Status GrowInSteps(double scale, double step) {
    for (int worse = 0; worse < kPatience;) {
      scale *= step;
      if (scale < kLeastScale || scale > kMostScale) break;
      const double least = Best().badness;
      ISOMATCH_RETURN_IF_ERROR(GrowAt(scale));
      worse = Best().badness < least ? 0 : worse + 1;
    }
    return absl::OkStatus();
  }

  const Grown& Best() const {
    return *std::min_element(grown_.begin(), grown_.end(), IsBetter);
  }

  static bool IsBetter(const Grown& a, const Grown& b) {
    return a.badness < b.badness;
  }

  static absl::Status NoOtherScale() {
    return absl::FailedPreconditionError("no other scale is likely");
  }

  /// The best scale that is better than the nearest that were grown at, and
  /// none of the best one's neighbors.
  absl::StatusOr<double> NextScale() {
    const double best = Best().scale;
    const double most =
        std::max_element(tried_.begin(), tried_.end(), HasLess)->support;
    for (const Tried& tried : tried_) {
      if (tried.support < kMuchSupport * most) continue;
      ISOMATCH_RETURN_IF_ERROR(GrowAt(tried.scale));
    }
    std::sort(grown_.begin(), grown_.end(),
              [](const Grown& a, const Grown& b) { return a.scale < b.scale; });
    std::vector<Grown> others;
    for (std::size_t i = 0; i < grown_.size(); ++i) {
      const bool is_least =
          (i == 0 || !IsBetter(grown_[i - 1], grown_[i])) &&
          (i + 1 == grown_.size() || !IsBetter(grown_[i + 1], grown_[i]));
      if (is_least && std::isfinite(grown_[i].badness) &&
          Apart(grown_[i].scale, best) > std::log(kOtherScale)) {
        others.push_back(grown_[i]);
      }
    }
    if (others.empty()) return NoOtherScale();
    return std::min_element(others.begin(), others.end(), IsBetter)->scale;
  }

  absl::StatusOr<Tried> Try(double scale) const {
    ISOMATCH_ASSIGN_OR_RETURN(const Start start, At(scale, kToScan));
    return Tried{scale, start.found.support, start.found.ratio};
  }

  static bool HasLess(const Tried& a, const Tried& b) {
    return a.support < b.support;
  }

  /// Those at which seeds have the most support, best first, and two beside.
  absl::StatusOr<std::vector<double>> Scales() {
    const double steps =
        std::log(kMostScale / kLeastScale) / std::log(kScaleStep);
    for (double scale = kLeastScale; scale < kMostScale; scale *= kScaleStep) {
      ISOMATCH_ASSIGN_OR_RETURN(const Tried tried, Try(scale));
      tried_.push_back(tried);
      control_.progress(0.1 +
                        0.4 * std::min(1.0, double(tried_.size()) / steps));
    }
    std::vector<double> scales;
    const auto add = [&](double scale) {
      if (std::none_of(scales.begin(), scales.end(), [&](double other) {
            return Apart(scale, other) < std::log(kSameScale);
          })) {
        scales.push_back(scale);
      }
    };
    for (const Tried& peak : Peaks(tried_)) {
      ISOMATCH_ASSIGN_OR_RETURN(const double exact, Corrected(peak));
      add(exact);
    }
    const double best = scales.front();
    add(best * kBesideThePeak);
    add(best / kBesideThePeak);
    return scales;
  }

  /// Local maxima of the support, best first.
  static std::vector<Tried> Peaks(const std::vector<Tried>& all) {
    std::vector<Tried> peaks;
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (i > 0 && all[i - 1].support > all[i].support) continue;
      if (i + 1 < all.size() && all[i + 1].support >= all[i].support) continue;
      peaks.push_back(all[i]);
    }
    std::stable_sort(
        peaks.begin(), peaks.end(),
        [](const Tried& a, const Tried& b) { return HasLess(b, a); });
    if (peaks.size() > kPeaks) peaks.resize(kPeaks);
    return peaks;
  }

  /// A scale between those that were tried, by what the distances say.
  absl::StatusOr<double> Corrected(Tried tried) const {
    for (int i = 0;
         i < kCorrections && Apart(tried.ratio, 1) > std::log(kExactRatio);
         ++i) {
      ISOMATCH_ASSIGN_OR_RETURN(
          const Tried next,
          Try(tried.scale * std::clamp(tried.ratio, 0.8, 1.25)));
      if (next.support < 0.9 * tried.support) break;
      tried = next;
    }
    return tried.scale * std::clamp(tried.ratio, 0.95, 1.05);
  }

  /// How bad the best map of the first stage is, by what it is ranked by and by
  /// how unlike its points look; infinity without seeds.
  absl::StatusOr<double> BadnessAt(double scale) const {
    const std::stop_token& stop = control_.stop;
    ISOMATCH_ASSIGN_OR_RETURN(const Start start, At(scale, kToCompare));
    if (start.found.seeds.empty()) {
      return std::numeric_limits<double>::infinity();
    }
    // In X's unit the kernel is as much wider.
    const Closeness closeness_x(x_.hash.basis, options_.kernel_width / scale);
    ISOMATCH_ASSIGN_OR_RETURN(
        const PointPool pool_x,
        PointPool::Create(closeness_x, of_x_.vertices, stop));
    PointFrames frames_x = of_x_.frames;
    frames_x.curvatures /= scale;
    FirstStageOptions first = FirstStageOptionsOf(options_, 0);
    first.max_results = 1;
    if (!oriented()) first.orientation_from = 0;
    const CandidateSearch all_points;
    const PointCosts costs = {start.differences, kUnlikenessWeight};
    ISOMATCH_ASSIGN_OR_RETURN(
        const std::vector<RankedMap> maps,
        RunFirstStage({pool_x, pool_y_, all_points, all_points, frames_x,
                       of_y_.frames, &costs},
                      start.found.seeds, first, nullptr, stop));
    const Matching& best = maps.front().matching;
    double unlikeness = 0;
    for (const auto& [x, y] : best.Matches()) {
      unlikeness += start.differences(y, x) / best.size();
    }
    // The smaller X, the less its distances can disagree; but it looks unlike.
    return maps.front().badness * unlikeness;
  }

  const PreparedMesh& x_;
  const PreparedMesh& y_;
  const MatchOptions& options_;
  const SearchControl& control_;
  const Closeness closeness_y_;
  PointPool pool_y_;  ///< of Scale
  Measured of_x_;
  Measured of_y_;
  bool is_mostly_rim_ = false;
  std::array<double, 2> radii_ = {};  ///< sqrt(area of Y)
  PointDescriptors described_y_;
  std::vector<Tried> tried_;  ///< by scale, in steps of kScaleStep
  std::vector<Grown> grown_;
};

}  // namespace

absl::StatusOr<PartStart> FindPartStart(const PreparedMesh& x,
                                        const PreparedMesh& y,
                                        absl::Span<const Landmark> landmarks,
                                        const MatchOptions& options,
                                        const SearchControl& control) {
  StartSearch search(x, y, options, control);
  ISOMATCH_RETURN_IF_ERROR(search.Prepare(landmarks));
  control.progress(0.1);
  double scale = std::sqrt(x.full.area / y.full.area);
  if (options.scale == LengthScale::kAuto) {
    ISOMATCH_ASSIGN_OR_RETURN(scale, search.Scale());
  }
  const bool overlap = options.relation == Relation::kOverlap;
  if (!overlap) ISOMATCH_RETURN_IF_ERROR(search.AvoidRim(scale));
  ISOMATCH_ASSIGN_OR_RETURN(Start start,
                            search.At(scale, overlap ? kToOverlap : kToMatch));
  control.progress(1);
  return std::move(search).Result(std::move(start));
}

}  // namespace isomatch
