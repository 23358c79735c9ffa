#pragma once

#include <stop_token>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "core/alignment/deformable_surface.h"
#include "core/base/nearest_columns.h"
#include "core/base/vertex_index.h"
#include "core/mesh/face_lanes.h"
#include "core/mesh/surface_point.h"
#include "core/mesh/triangle_mesh.h"
#include "core/mesh/vertex_stars.h"
#include "core/spectral/cotan_laplacian.h"

namespace isomatch {

/// One shape as the alignment sees it: of surface area 1. References must
/// outlive the alignment.
struct AlignmentShape {
  const TriangleMesh& mesh;
  const Positions& normals;
  const CotanLaplacian& laplacian;
  const PointColumns& functions;  ///< FunctionColumns of the eigenfunctions
  const VertexStars& stars;
  /// FacesAroundVertices, which alignments of one pair share; else each that
  /// needs them makes its own.
  const std::vector<FaceLanes>* faces = nullptr;
};

/// What makes two points of the aligned surfaces alike: squared differences of
/// position (unit sqrt(area)), and of the following with their weights.
struct AlignmentOptions {
  /// Eigenfunctions whose values are compared, cut to the bases at hand.
  int basis = 128;
  double spectral_weight = 0.03;
  /// Weight of the difference of unit normals. 0 on unoriented surfaces, whose
  /// normals mean nothing.
  double normal_weight = 0.3;
  /// Y is bent in place of X, whose functions are carried to Y's basis in place
  /// of Y's to X's: where X is a part of Y, Y knows how what X lacks hangs
  /// together, and all of its functions restrict to X, but few of X's extend to
  /// Y.
  bool bend_y = false;
};

/// How hard it is to lay one surface on the other: each 0 for congruent ones,
/// >= 0.
struct AlignmentScore {
  /// As-rigid-as-possible energy over X's area.
  double stretch = 0;
  /// Mean 1 - cosine between the normals of aligned points, area-weighted.
  double normal_mismatch = 0;
};

/// Refines a dense map by laying the surface of X elastically on that of Y: X
/// bends freely and stretches under resistance toward where the map sends it;
/// the map is then found anew as the most alike point in space, normal and
/// eigenfunctions (carried over by the functional map of the current map, of
/// whole shapes by that of the first round at a stiffness), and so on.
/// Eigenfunctions keep limbs apart that touch in space; positions and normals
/// see detail that no low frequencies show. In spirit of smooth shells
/// (Eisenberger, Laehner, Cremers, CVPR 2020) and of non-rigid ICP. With
/// AlignmentOptions::bend_y it is Y that bends, toward what it is the image of.
///
/// Not in the paper. Deterministic at any thread count. Not thread-safe.
class ElasticAlignment {
 public:
  /// REQUIRES: y_from_x is dense, options.basis >= 1.
  ElasticAlignment(const AlignmentShape& shape_x, const AlignmentShape& shape_y,
                   const AlignmentOptions& options, VertexMap y_from_x);

  /// Lets the images of landmarks stay where they are and pulls the surfaces
  /// together there.
  void Fix(absl::Span<const VertexMatch> landmarks);

  /// Marks the vertices of X that have a counterpart on Y, one entry each, not
  /// 0 for those; without a call all have. The others are not pulled, and
  /// follow their neighbors. REQUIRES: X is what bends.
  void SetMatched(std::vector<char> matched);
  /// Empty: all.
  const std::vector<char>& matched() const { return matched_; }

  /// Deforms the surface `steps` times toward where it was pulled last. Errors
  /// as Run.
  absl::Status Settle(double stiffness, int steps, const std::stop_token& stop);

  /// `rounds` of deforming and matching anew at one stiffness, a fraction of
  /// the area (> 0). INTERNAL: a factorization failed. CANCELLED after `stop`.
  /// Time O(rounds n basis^2) and a sparse Cholesky, each round where Y bends.
  absl::Status Run(double stiffness, int rounds, const std::stop_token& stop);

  const VertexMap& y_from_x() const { return y_from_x_; }
  /// REQUIRES of the following: Run.
  ///
  /// For each vertex of X the most alike point of the faces around its image;
  /// of landmarks the image. CANCELLED after `stop`.
  absl::StatusOr<std::vector<SurfacePoint>> PrecisePoints(
      const std::stop_token& stop);
  /// Of the vertices that are matched.
  AlignmentScore Score() const;
  /// Distance of a vertex of X from Y around its image, as the surfaces lie on
  /// each other, sqrt(area).
  double Residual(VertexIndex x) const;
  /// 1 - cosine between the normals there.
  double NormalMismatch(VertexIndex x) const;

 private:
  const AlignmentShape& bending() const { return options_.bend_y ? y_ : x_; }
  /// As the surfaces lie on each other.
  const TriangleMesh& laid_x() const {
    return options_.bend_y ? x_.mesh : bent_;
  }
  const TriangleMesh& laid_y() const {
    return options_.bend_y ? bent_ : y_.mesh;
  }
  void StartX();
  void StartY();
  void DescribeFunctions();
  void DescribeBent();
  /// Deforms the surface toward the targets.
  absl::Status Pull(int steps, const std::stop_token& stop);
  bool matched(VertexIndex x) const { return matched_.empty() || matched_[x]; }
  absl::Status FindAlike(const std::stop_token& stop);
  absl::Status FindPoints(const std::stop_token& stop);
  SurfacePoint NearestPoint(VertexIndex x,
                            const Eigen::RowVector3d& position) const;
  void SetTargetOfX(VertexIndex x);
  void SetTargetsOfY(double overrelaxation);

  const AlignmentShape x_;
  const AlignmentShape y_;
  const AlignmentOptions options_;
  const Eigen::Index basis_;
  DeformableSurface surface_;
  /// Where Y, which does not bend, came without.
  const std::vector<FaceLanes> own_faces_y_;
  TriangleMesh bent_;  ///< one surface laid on the other
  Positions normals_;  ///< of bent_
  VertexMap y_from_x_;
  VertexMap fixed_;                   ///< images of landmarks, else kNoVertex
  std::vector<SurfacePoint> points_;  ///< nearest in space, around the image
  /// What each vertex of bent_ is pulled to, and how much.
  Positions targets_;
  Eigen::VectorXd pull_;
  std::vector<char> matched_;
  /// One vertex a column: eigenfunctions, position, normal, weighted.
  PointColumns features_x_;
  PointColumns features_y_;
};

}  // namespace isomatch
