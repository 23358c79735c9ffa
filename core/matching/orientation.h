#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/matching/matching.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// What is known of the surface at a pool's points.
struct PointFrames {
  Positions positions;         ///< P x 3, mesh units
  Positions normals;           ///< P x 3, unit, outward
  Eigen::VectorXd curvatures;  ///< P, mean curvature, 1 / mesh units
};

/// Returns the rows of `positions`, `normals` and `curvatures` that belong to
/// the pool.
PointFrames GatherFrames(const Positions& positions, const Positions& normals,
                         const Eigen::VectorXd& curvatures,
                         const PointPool& pool);

/// On which side of each other, seen from outside, points b and c lie around a:
/// n_a . (ab x ac) with unit ab and ac, in [-1, 1].
double SideAround(const PointFrames& frames, int a, int b, int c);

/// SideAround of one point and any two of a few others.
class SidesAround {
 public:
  static constexpr int kMost = 8;

  SidesAround(const PointFrames& frames, int a) : frames_(frames), a_(a) {}

  /// REQUIRES: fewer than kMost points so far.
  void Add(int b) {
    directions_[count_++] =
        (frames_.positions.row(b) - frames_.positions.row(a_)).normalized();
  }

  /// Of those that were added as the i-th and the j-th.
  double Side(int i, int j) const {
    return frames_.normals.row(a_).dot(directions_[i].cross(directions_[j]));
  }

 private:
  const PointFrames& frames_;
  const int a_;
  int count_ = 0;
  std::array<Eigen::RowVector3d, kMost> directions_;
};

/// Tells a map from its mirror image. For each match a and each two (b, c) of
/// its 6 nearest matches: whether b and c lie on the same side of each other
/// around a's outward normal on both shapes, n_a . (ab x ac) on X times the
/// same on Y, summed and divided by the sum of magnitudes.
///
/// In [-1, 1]: near 1 when orientation is kept, near -1 for a mirrored map; 0
/// with fewer than 3 matches. It cannot see orientation-preserving symmetries.
/// Not in the paper.
double OrientationScore(const Matching& matching, const PointFrames& frames_x,
                        const PointFrames& frames_y);

/// The same around each match alone, averaged with those of its 6 nearest
/// matches: negative where a region is mirrored although the map as a whole is
/// not. One entry a match, in [-1, 1].
std::vector<double> LocalOrientations(const Matching& matching,
                                      const PointFrames& frames_x,
                                      const PointFrames& frames_y);

/// Mean over the matches of the difference of mean curvature, 1 / mesh units.
/// It tells a map from one that intrinsic distances and orientation cannot: the
/// half turn of a body that swaps front with back and left with right. 0
/// without matches. Not in the paper.
double CurvatureMismatch(const Matching& matching, const PointFrames& frames_x,
                         const PointFrames& frames_y);

}  // namespace isomatch
