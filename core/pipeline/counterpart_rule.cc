#include "core/pipeline/counterpart_rule.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <numeric>
#include <utility>

#include "core/base/parallel.h"
#include "core/base/status_macros.h"
#include "core/geodesic/rim_distance.h"
#include "core/mesh/disjoint_sets.h"

namespace isomatch {
namespace {

/// Of a sparse match, sqrt(area).
constexpr float kNearMatch = 0.06f;
/// 1 - cosine between normals.
constexpr double kMostTurned = 0.5;
/// Beyond the rim: nearest to it, but farther away than this, sqrt(area).
constexpr double kBeyondRim = 0.01;
/// Vertices of X farther apart than this do not have one place on Y; the one
/// stays that is nearer, by residual and this much of the normals' mismatch.
constexpr float kOnePlace = 0.1f;
constexpr double kTurnWeight = 0.1;
/// A border nearer to a rim than this ends there, sqrt(area).
constexpr float kAtRim = 0.06f;
/// Vertices from which distances are compared, at most; for the distortion to
/// one in so many others, and the difference that counts most there.
constexpr VertexIndex kSources = 80;
constexpr VertexIndex kOthers = 7;
constexpr double kMostDifference = 0.3;
/// A vertex contradicts others where the median difference is larger than this
/// and that part of the distance. A twelfth of the sources is left out at a
/// time, down to a number that says nothing any more.
constexpr float kMostExcess = 0.05f;
constexpr float kRelativeExcess = 0.1f;
constexpr std::size_t kPartLeftOut = 12;
constexpr std::size_t kLeastSources = 6;
/// A matched region that has less of X's area, unless it is the largest one, is
/// a speck; what is left out and has less than that is a gap, where at most
/// that part of the edges to it has its matched end at Y's rim.
constexpr double kLargestSpeck = 0.02;
constexpr double kLargestGap = 0.1;
constexpr double kMostAtRim = 0.2;
/// Changes that the fields are not followed to.
constexpr float kFieldChange = 1e-3f;

}  // namespace

CounterpartRule::CounterpartRule(const PreparedMesh& x, const PreparedMesh& y,
                                 const std::stop_token& stop)
    : x_(x),
      solved_x_(x.solved()),
      solved_y_(y.solved()),
      stop_(stop),
      solver_x_(solved_x_.mesh, stop_),
      solver_y_(solved_y_.mesh, stop_),
      rim_distances_x_(RimDistances(solved_x_.mesh, solver_x_)),
      rim_distances_y_(RimDistances(solved_y_.mesh, solver_y_)) {}

std::vector<char> CounterpartRule::NearMatches(
    absl::Span<const VertexMatch> matches) const {
  DistanceFieldSolver::Workspace workspace;
  const VertexIndex n = solved_x_.mesh.num_vertices();
  std::vector<float> distances(n, kNearMatch);
  for (const VertexMatch& match : matches) {
    solver_x_.Lower(match.x, absl::MakeSpan(distances), &workspace);
  }
  std::vector<char> matched(n, false);
  for (VertexIndex x = 0; x < n; ++x) matched[x] = distances[x] < kNearMatch;
  return matched;
}

std::vector<char> CounterpartRule::Matched(const ElasticAlignment& alignment,
                                           double tolerance) const {
  std::vector<char> matched(solved_x_.mesh.num_vertices(), false);
  for (VertexIndex x = 0; x < solved_x_.mesh.num_vertices(); ++x) {
    const double residual = alignment.Residual(x);
    const VertexIndex y = alignment.y_from_x()[x];
    matched[x] = residual < tolerance &&
                 alignment.NormalMismatch(x) < kMostTurned &&
                 !(rim_distances_y_[y] <= 0 && residual > kBeyondRim);
  }
  KeepOneEach(alignment, &matched);
  return matched;
}

void CounterpartRule::KeepOneEach(const ElasticAlignment& alignment,
                                  std::vector<char>* matched) const {
  const auto misfit = [&](VertexIndex x) {
    return alignment.Residual(x) + kTurnWeight * alignment.NormalMismatch(x);
  };
  VertexMap best(solved_y_.mesh.num_vertices(), kNoVertex);
  for (VertexIndex x = 0; x < solved_x_.mesh.num_vertices(); ++x) {
    if (!(*matched)[x]) continue;
    VertexIndex& other = best[alignment.y_from_x()[x]];
    if (other == kNoVertex || misfit(x) < misfit(other)) other = x;
  }
  for (VertexIndex x = 0; x < solved_x_.mesh.num_vertices(); ++x) {
    if (!(*matched)[x]) continue;
    const VertexIndex other = best[alignment.y_from_x()[x]];
    if (x_.hash.basis.LowerBound(x, other) > kOnePlace) (*matched)[x] = false;
  }
}

double CounterpartRule::OpenBorder(const ElasticAlignment& alignment) const {
  const std::vector<char>& matched = alignment.matched();
  double length = 0;
  for (VertexIndex x = 0; x < solved_x_.mesh.num_vertices(); ++x) {
    if (!matched[x] || rim_distances_x_[x] <= kAtRim ||
        rim_distances_y_[alignment.y_from_x()[x]] <= kAtRim) {
      continue;
    }
    for (const VertexIndex neighbor : solved_x_.stars.Neighbors(x)) {
      if (matched[neighbor]) continue;
      length += (solved_x_.mesh.positions.row(x) -
                 solved_x_.mesh.positions.row(neighbor))
                    .norm();
    }
  }
  return length;
}

absl::Status CounterpartRule::SolveSources() {
  const VertexIndex n = solved_x_.mesh.num_vertices();
  std::vector<VertexIndex> all;
  const VertexIndex step = (n + kSources - 1) / kSources;
  for (VertexIndex x = 0; x < n; x += step) all.push_back(x);
  ISOMATCH_ASSIGN_OR_RETURN(
      from_x_, BasisPoints::Create(solver_x_, std::move(all), nullptr, stop_,
                                   kFieldChange));
  return absl::OkStatus();
}

absl::StatusOr<CounterpartRule::ComparedFields> CounterpartRule::FieldsOf(
    const VertexMap& y_from_x, const std::vector<char>& matched) const {
  ComparedFields fields;
  std::vector<VertexIndex> images;
  for (int z = 0; z < from_x_.num_points(); ++z) {
    const VertexIndex x = from_x_.points()[z];
    if (!matched[x]) continue;
    fields.sources.push_back(z);
    images.push_back(y_from_x[x]);
  }
  if (fields.sources.empty()) return fields;
  ISOMATCH_ASSIGN_OR_RETURN(fields.from_images,
                            BasisPoints::Create(solver_y_, std::move(images),
                                                nullptr, stop_, kFieldChange));
  return fields;
}

absl::Status CounterpartRule::LeaveOutContradicting(
    const ElasticAlignment& alignment, std::vector<char>* matched) const {
  const VertexMap& y_from_x = alignment.y_from_x();
  ISOMATCH_ASSIGN_OR_RETURN(const ComparedFields fields,
                            FieldsOf(y_from_x, *matched));
  std::vector<int> asked(fields.sources.size());  // positions in `fields`
  std::iota(asked.begin(), asked.end(), 0);
  const auto median_excess = [&](VertexIndex x) {
    const float* const from_x = from_x_.Profile(x);
    const float* const from_y = fields.from_images.Profile(y_from_x[x]);
    std::vector<float> excesses;
    excesses.reserve(asked.size());
    for (const int i : asked) {
      const float distance = from_x[fields.sources[i]];
      excesses.push_back(std::abs(distance - from_y[i]) -
                         kRelativeExcess * distance);
    }
    const auto middle = excesses.begin() + std::ssize(excesses) / 2;
    std::nth_element(excesses.begin(), middle, excesses.end());
    return *middle;
  };
  while (asked.size() >= kLeastSources) {
    std::vector<std::pair<float, int>> contradicting;
    for (const int i : asked) {
      const float excess = median_excess(from_x_.points()[fields.sources[i]]);
      if (excess > kMostExcess) contradicting.emplace_back(-excess, i);
    }
    if (contradicting.empty()) break;
    std::sort(contradicting.begin(), contradicting.end());
    const std::size_t most =
        std::max<std::size_t>(1, asked.size() / kPartLeftOut);
    contradicting.resize(std::min(contradicting.size(), most));
    for (const auto& [excess, i] : contradicting) std::erase(asked, i);
  }
  if (asked.size() < kLeastSources) return absl::OkStatus();
  return ParallelForVertices(
      solved_x_.mesh.num_vertices(), stop_, [&](VertexIndex x) {
        if ((*matched)[x] && median_excess(x) > kMostExcess) {
          (*matched)[x] = false;
        }
      });
}

CounterpartRule::Regions CounterpartRule::RegionsOf(
    const VertexMap& y_from_x, const std::vector<char>& matched) const {
  const VertexIndex n = solved_x_.mesh.num_vertices();
  DisjointSets sets(n);
  for (VertexIndex x = 0; x < n; ++x) {
    for (const VertexIndex neighbor : solved_x_.stars.Neighbors(x)) {
      if (matched[x] == matched[neighbor]) sets.Join(x, neighbor);
    }
  }
  Regions regions = {VertexMap(n), std::vector<Region>(n)};
  for (VertexIndex x = 0; x < n; ++x) {
    regions.first_of[x] = sets.Find(x);
    Region& region = regions.by_first[regions.first_of[x]];
    region.area += x_.laplacian.mass[x];
    for (const VertexIndex neighbor : solved_x_.stars.Neighbors(x)) {
      if (matched[x] == matched[neighbor]) continue;
      const VertexIndex image = y_from_x[matched[x] ? x : neighbor];
      ++region.edges;
      region.at_rim += rim_distances_y_[image] <= kAtRim;
    }
  }
  return regions;
}

void CounterpartRule::Smooth(const ElasticAlignment& alignment,
                             std::vector<char>* matched) const {
  const VertexIndex n = solved_x_.mesh.num_vertices();
  const double area = x_.laplacian.mass.sum();
  const Regions before = RegionsOf(alignment.y_from_x(), *matched);
  double largest = 0;  // of what is matched
  for (VertexIndex x = 0; x < n; ++x) {
    if ((*matched)[x]) largest = std::max(largest, before.Of(x).area);
  }
  const double least = std::min(kLargestSpeck * area, largest);
  for (VertexIndex x = 0; x < n; ++x) {
    const Region& region = before.Of(x);
    if (region.area < least && region.edges > 0) (*matched)[x] = false;
  }
  const Regions regions = RegionsOf(alignment.y_from_x(), *matched);
  for (VertexIndex x = 0; x < n; ++x) {
    const Region& region = regions.Of(x);
    const bool is_enclosed =
        region.edges > 0 && region.at_rim <= kMostAtRim * region.edges;
    if (is_enclosed && region.area < kLargestGap * area) (*matched)[x] = true;
  }
}

absl::StatusOr<OverlapMisfit> CounterpartRule::Misfit(
    const ElasticAlignment& alignment) const {
  const std::vector<char>& matched = alignment.matched();
  const VertexMap& y_from_x = alignment.y_from_x();
  ISOMATCH_ASSIGN_OR_RETURN(const ComparedFields fields,
                            FieldsOf(y_from_x, matched));
  OverlapMisfit misfit;
  std::int64_t compared = 0;
  for (VertexIndex x = 0;
       x < solved_x_.mesh.num_vertices() && !fields.sources.empty();
       x += kOthers) {
    if (!matched[x]) continue;
    const float* const from_x = from_x_.Profile(x);
    const float* const from_y = fields.from_images.Profile(y_from_x[x]);
    for (std::size_t i = 0; i < fields.sources.size(); ++i, ++compared) {
      misfit.distortion += std::min<double>(
          kMostDifference, std::abs(from_x[fields.sources[i]] - from_y[i]));
    }
  }
  if (compared > 0) misfit.distortion /= static_cast<double>(compared);
  misfit.open_border = OpenBorder(alignment);
  return misfit;
}

}  // namespace isomatch
