#include "core/matching/orientation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "absl/types/span.h"
#include "core/matching/nearest_list.h"

namespace isomatch {
namespace {

constexpr std::size_t kNeighbors = 6;

/// The nearest matches of one, nearest first, ties by index.
struct NearMatches {
  std::size_t count = 0;
  std::array<int, kNeighbors> matches;

  absl::Span<const int> all() const { return {matches.data(), count}; }
};

NearMatches NearestMatches(const Matching& matching, int a) {
  NearMatches near;
  std::array<float, kNeighbors> closeness;
  const NearestList list = {near.matches.data(), closeness.data(), kNeighbors};
  for (int b = 0; b < matching.size(); ++b) {
    if (b == a) continue;
    list.Offer(near.count, b, matching.closeness(kX, a, b));
    near.count = std::min(near.count + 1, kNeighbors);
  }
  return near;
}

/// A sum of products of turns on both shapes, and of their magnitudes.
struct Turns {
  double sum = 0;
  double magnitude = 0;
  double Score() const { return magnitude > 0 ? sum / magnitude : 0; }
};

/// Those of the two shapes.
struct FramesOfBoth {
  const PointFrames& x;
  const PointFrames& y;
};

void AddTurns(const Matching& matching, const FramesOfBoth& frames, int a,
              absl::Span<const int> near, Turns* turns) {
  SidesAround on_x(frames.x, matching.point(kX, a));
  SidesAround on_y(frames.y, matching.point(kY, a));
  for (int i = 0; i < static_cast<int>(near.size()); ++i) {
    on_x.Add(matching.point(kX, near[i]));
    on_y.Add(matching.point(kY, near[i]));
    for (int j = 0; j < i; ++j) {
      const double product = on_x.Side(i, j) * on_y.Side(i, j);
      turns->sum += product;
      turns->magnitude += std::abs(product);
    }
  }
}

}  // namespace

double SideAround(const PointFrames& frames, int a, int b, int c) {
  SidesAround sides(frames, a);
  sides.Add(b);
  sides.Add(c);
  return sides.Side(0, 1);
}

PointFrames GatherFrames(const Positions& positions, const Positions& normals,
                         const Eigen::VectorXd& curvatures,
                         const PointPool& pool) {
  PointFrames frames;
  frames.positions = positions(pool.vertices(), Eigen::all);
  frames.normals = normals(pool.vertices(), Eigen::all);
  frames.curvatures = curvatures(pool.vertices());
  return frames;
}

double OrientationScore(const Matching& matching, const PointFrames& frames_x,
                        const PointFrames& frames_y) {
  Turns turns;
  for (int a = 0; a < matching.size(); ++a) {
    AddTurns(matching, {frames_x, frames_y}, a,
             NearestMatches(matching, a).all(), &turns);
  }
  return turns.Score();
}

std::vector<double> LocalOrientations(const Matching& matching,
                                      const PointFrames& frames_x,
                                      const PointFrames& frames_y) {
  std::vector<NearMatches> near;
  std::vector<double> own;
  for (int a = 0; a < matching.size(); ++a) {
    near.push_back(NearestMatches(matching, a));
    Turns turns;
    AddTurns(matching, {frames_x, frames_y}, a, near.back().all(), &turns);
    own.push_back(turns.Score());
  }
  std::vector<double> averaged = own;
  for (int a = 0; a < matching.size(); ++a) {
    for (const int b : near[a].all()) averaged[a] += own[b];
    averaged[a] /= static_cast<double>(near[a].count + 1);
  }
  return averaged;
}

double CurvatureMismatch(const Matching& matching, const PointFrames& frames_x,
                         const PointFrames& frames_y) {
  if (matching.size() == 0) return 0;
  double sum = 0;
  for (int i = 0; i < matching.size(); ++i) {
    sum += std::abs(frames_x.curvatures[matching.point(kX, i)] -
                    frames_y.curvatures[matching.point(kY, i)]);
  }
  return sum / matching.size();
}

}  // namespace isomatch
