#pragma once

#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace isomatch {

/// A part of the animal: a bent tube around a center line.
struct AnimalChain {
  /// Nodes of the center line at rest, and the tube's radius there.
  std::vector<Eigen::Vector3d> nodes;
  std::vector<double> radii;
  /// The chain it grows from; -1 for the trunk.
  int parent = -1;
};

/// The animal at rest, as the zero set of a smooth function: nose along x, left
/// along y, up along z, about 2 units long. Trunk, neck with head, two ears,
/// tail and four legs all differ in length and width, so that neither left and
/// right nor any two limbs can be mistaken for one another.
class AnimalBody {
 public:
  /// Signed distance to the surface, about; negative inside.
  struct Field {
    double value;
    Eigen::Vector3d gradient;
  };

  AnimalBody();

  Field At(const Eigen::Vector3d& point) const;

  /// Returns the surface point near `point`, by `steps` steps of Newton.
  Eigen::Vector3d Project(Eigen::Vector3d point, int steps) const;

  /// A box that holds the surface with some room.
  Eigen::AlignedBox3d Bounds() const;

  const std::vector<AnimalChain>& chains() const { return chains_; }

 private:
  std::vector<AnimalChain> chains_;
};

/// A pose: bends every chain along its length, so that lengths along the
/// surface change by radius / radius of curvature at most.
class AnimalPose {
 public:
  static constexpr char kPoses[] = "ABC";

  /// REQUIRES: `pose` is one of kPoses. Keeps a reference to `body`.
  AnimalPose(const AnimalBody& body, char pose);

  /// Returns where a point of the surface at rest goes.
  Eigen::Vector3d operator()(const Eigen::Vector3d& rest) const;

 private:
  /// A node of a chain, posed.
  struct Frame {
    Eigen::Vector3d origin;
    Eigen::Quaterniond rotation;
  };

  Eigen::Vector3d MoveWithChain(std::size_t chain,
                                const Eigen::Vector3d& rest) const;
  void PoseChain(std::size_t chain, char pose);

  const AnimalBody& body_;
  std::vector<std::vector<Frame>> frames_;
};

}  // namespace isomatch
