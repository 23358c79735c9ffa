#include "core/alignment/elastic_alignment.h"

#include <algorithm>
#include <utility>

#include "core/base/parallel.h"
#include "core/base/status_macros.h"
#include "core/mesh/mesh_geometry.h"
#include "core/mesh/surface_samples.h"
#include "core/spectral/functional_map.h"

namespace isomatch {
namespace {

/// Calls of DeformableSurface::Step between two searches for matches.
constexpr int kStepsPerRound = 3;
/// Points are pulled beyond where they belong by this part of their way, so
/// that the surface slides into place in half the rounds.
constexpr double kOverrelaxation = 1;
/// How much more than others a landmark is pulled.
constexpr double kLandmarkPull = 100;
/// How much vertices are pulled that have no counterpart: not at all, but for
/// what keeps the system regular.
constexpr double kUnmatchedPull = 1e-4;

}  // namespace

ElasticAlignment::ElasticAlignment(const AlignmentShape& shape_x,
                                   const AlignmentShape& shape_y,
                                   const AlignmentOptions& options,
                                   VertexMap y_from_x)
    : x_(shape_x),
      y_(shape_y),
      options_(options),
      basis_(std::min<Eigen::Index>(
          {options.basis, shape_x.functions.rows(), shape_y.functions.rows()})),
      surface_(shape_x.mesh, shape_x.laplacian),
      faces_y_(FacesAroundVertices(shape_y.mesh, shape_y.stars)),
      aligned_(shape_x.mesh),
      y_from_x_(std::move(y_from_x)),
      fixed_(shape_x.mesh.num_vertices(), kNoVertex),
      points_(shape_x.mesh.num_vertices()),
      targets_(y_.mesh.positions(y_from_x_, Eigen::all)),
      pull_(shape_x.laplacian.mass),
      features_x_(basis_ + 6, shape_x.mesh.num_vertices()),
      features_y_(basis_ + 6, shape_y.mesh.num_vertices()) {
  aligned_.positions = targets_;
  const auto weight = static_cast<float>(options_.spectral_weight);
  (options_.carry_x ? features_y_ : features_x_).topRows(basis_) =
      weight * (options_.carry_x ? y_ : x_).functions.topRows(basis_);
  features_y_.middleRows(basis_, 3) =
      y_.mesh.positions.transpose().cast<float>();
  features_y_.bottomRows(3) =
      (options_.normal_weight * y_.normals.transpose()).cast<float>();
}

void ElasticAlignment::Fix(absl::Span<const VertexMatch> landmarks) {
  for (const VertexMatch& landmark : landmarks) {
    fixed_[landmark.x] = landmark.y;
    y_from_x_[landmark.x] = landmark.y;
    targets_.row(landmark.x) = y_.mesh.positions.row(landmark.y);
    pull_[landmark.x] = kLandmarkPull * x_.laplacian.mass[landmark.x];
  }
}

void ElasticAlignment::DescribeFunctions() {
  if (options_.carry_x) {
    const Eigen::MatrixXf y_from_x =
        DenseFunctionalMap(x_.functions.topRows(basis_), x_.laplacian.mass,
                           features_y_.topRows(basis_), y_from_x_);
    CarryOver(y_from_x.transpose(), x_.functions.topRows(basis_),
              features_x_.topRows(basis_));
    return;
  }
  // Fitted to X's features, not its functions: they hold the spectral weight.
  const Eigen::MatrixXf fmap_x_from_y =
      DenseFunctionalMap(features_x_.topRows(basis_), x_.laplacian.mass,
                         y_.functions.topRows(basis_), y_from_x_);
  CarryOver(fmap_x_from_y, y_.functions.topRows(basis_),
            features_y_.topRows(basis_));
}

void ElasticAlignment::DescribeX() {
  normals_ = VertexNormals(aligned_);
  features_x_.middleRows(basis_, 3) =
      aligned_.positions.transpose().cast<float>();
  features_x_.bottomRows(3) =
      (options_.normal_weight * normals_.transpose()).cast<float>();
}

absl::Status ElasticAlignment::FindAlike(const std::stop_token& stop) {
  const PointsOnSurface points_x = {x_.stars, x_.laplacian.mass, features_x_};
  const PointsOnSurface points_y = {y_.stars, y_.laplacian.mass, features_y_};
  ISOMATCH_ASSIGN_OR_RETURN(
      y_from_x_, DescendFromMap(points_x, points_y, y_from_x_, stop));
  for (std::size_t x = 0; x < fixed_.size(); ++x) {
    if (fixed_[x] != kNoVertex) y_from_x_[x] = fixed_[x];
  }
  return absl::OkStatus();
}

absl::Status ElasticAlignment::FindPoints(const std::stop_token& stop) {
  return ParallelForVertices(x_.mesh.num_vertices(), stop, [&](VertexIndex x) {
    const bool fixed = fixed_[x] != kNoVertex;
    const Eigen::RowVector3d aligned = aligned_.positions.row(x);
    const Eigen::RowVector3d wanted =
        fixed ? Eigen::RowVector3d(y_.mesh.positions.row(fixed_[x])) : aligned;
    points_[x] = faces_y_[y_from_x_[x]].Nearest(wanted);
    targets_.row(x) = PositionOf(y_.mesh, points_[x]);
    if (!fixed) {
      targets_.row(x) += kOverrelaxation * (targets_.row(x) - aligned);
    }
  });
}

void ElasticAlignment::SetMatched(std::vector<char> matched) {
  matched_ = std::move(matched);
  for (VertexIndex x = 0; x < x_.mesh.num_vertices(); ++x) {
    if (fixed_[x] != kNoVertex) continue;
    pull_[x] = x_.laplacian.mass[x] * (matched_[x] ? 1 : kUnmatchedPull);
  }
}

absl::Status ElasticAlignment::Settle(double stiffness, int steps,
                                      const std::stop_token& stop) {
  ISOMATCH_RETURN_IF_ERROR(surface_.SetPull(pull_, stiffness));
  return PullX(steps, stop);
}

absl::Status ElasticAlignment::PullX(int steps, const std::stop_token& stop) {
  for (int step = 0; step < steps; ++step) {
    ISOMATCH_RETURN_IF_ERROR(
        surface_.Step(targets_, stop, &aligned_.positions));
  }
  return absl::OkStatus();
}

absl::Status ElasticAlignment::Run(double stiffness, int rounds,
                                   const std::stop_token& stop) {
  ISOMATCH_RETURN_IF_ERROR(surface_.SetPull(pull_, stiffness));
  for (int round = 0; round < rounds; ++round) {
    ISOMATCH_RETURN_IF_ERROR(PullX(kStepsPerRound, stop));
    DescribeX();
    // At one stiffness the functional map hardly changes, but for parts.
    if (round == 0 || options_.carry_x) DescribeFunctions();
    ISOMATCH_RETURN_IF_ERROR(FindAlike(stop));
    ISOMATCH_RETURN_IF_ERROR(FindPoints(stop));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<SurfacePoint>> ElasticAlignment::PrecisePoints(
    const std::stop_token& stop) {
  std::vector<SurfacePoint> precise(x_.mesh.num_vertices());
  ISOMATCH_RETURN_IF_ERROR(
      ParallelForVertices(x_.mesh.num_vertices(), stop, [&](VertexIndex x) {
        // What a landmark is like does not matter: its point is at its image.
        precise[x] = fixed_[x] != kNoVertex
                         ? points_[x]
                         : NearestOnFaces(y_.mesh.faces,
                                          y_.stars.SomeFaces(y_from_x_[x]),
                                          features_y_, features_x_.col(x));
      }));
  return precise;
}

double ElasticAlignment::Residual(VertexIndex x) const {
  return (aligned_.positions.row(x) - PositionOf(y_.mesh, points_[x])).norm();
}

double ElasticAlignment::NormalMismatch(VertexIndex x) const {
  return 1 - normals_.row(x).dot(y_.normals.row(y_from_x_[x]));
}

AlignmentScore ElasticAlignment::Score() const {
  AlignmentScore score;
  const Eigen::VectorXd& mass = x_.laplacian.mass;
  double matched_mass = matched_.empty() ? mass.sum() : 0;
  for (VertexIndex x = 0; x < x_.mesh.num_vertices(); ++x) {
    if (!matched(x)) continue;
    score.normal_mismatch += mass[x] * NormalMismatch(x);
    if (!matched_.empty()) matched_mass += mass[x];
  }
  score.normal_mismatch /= matched_mass;
  score.stretch = surface_.Energy(aligned_.positions) / mass.sum();
  return score;
}

}  // namespace isomatch
