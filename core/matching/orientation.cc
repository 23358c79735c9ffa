#include "core/matching/orientation.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

namespace isomatch {
namespace {

constexpr int kNeighbors = 6;

std::vector<int> NearestMatches(const Matching& matching, int a) {
  std::vector<std::pair<float, int>> nearest;
  for (int b = 0; b < matching.size(); ++b) {
    if (b != a) nearest.emplace_back(-matching.closeness(kX, a, b), b);
  }
  const auto end =
      nearest.begin() + std::min<std::size_t>(kNeighbors, nearest.size());
  std::partial_sort(nearest.begin(), end, nearest.end());
  std::vector<int> result;
  for (auto it = nearest.begin(); it != end; ++it) result.push_back(it->second);
  return result;
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
              const std::vector<int>& near, Turns* turns) {
  for (std::size_t i = 0; i < near.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const double product =
          SideAround(frames.x, matching.point(kX, a),
                     matching.point(kX, near[i]), matching.point(kX, near[j])) *
          SideAround(frames.y, matching.point(kY, a),
                     matching.point(kY, near[i]), matching.point(kY, near[j]));
      turns->sum += product;
      turns->magnitude += std::abs(product);
    }
  }
}

}  // namespace

double SideAround(const PointFrames& frames, int a, int b, int c) {
  const Eigen::RowVector3d origin = frames.positions.row(a);
  const Eigen::RowVector3d to_b =
      (frames.positions.row(b) - origin).normalized();
  const Eigen::RowVector3d to_c =
      (frames.positions.row(c) - origin).normalized();
  return frames.normals.row(a).dot(to_b.cross(to_c));
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
    AddTurns(matching, {frames_x, frames_y}, a, NearestMatches(matching, a),
             &turns);
  }
  return turns.Score();
}

std::vector<double> LocalOrientations(const Matching& matching,
                                      const PointFrames& frames_x,
                                      const PointFrames& frames_y) {
  std::vector<std::vector<int>> near;
  std::vector<double> own;
  for (int a = 0; a < matching.size(); ++a) {
    near.push_back(NearestMatches(matching, a));
    Turns turns;
    AddTurns(matching, {frames_x, frames_y}, a, near.back(), &turns);
    own.push_back(turns.Score());
  }
  std::vector<double> averaged = own;
  for (int a = 0; a < matching.size(); ++a) {
    for (const int b : near[a]) averaged[a] += own[b];
    averaged[a] /= static_cast<double>(near[a].size() + 1);
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
