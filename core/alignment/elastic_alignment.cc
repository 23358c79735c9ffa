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
      surface_(bending().mesh, bending().laplacian),
      own_faces_y_(options.bend_y || shape_y.faces != nullptr
                       ? std::vector<FaceLanes>()
                       : FacesAroundVertices(shape_y.mesh, shape_y.stars)),
      bent_(bending().mesh),
      y_from_x_(std::move(y_from_x)),
      fixed_(shape_x.mesh.num_vertices(), kNoVertex),
      points_(shape_x.mesh.num_vertices()),
      features_x_(basis_ + 6, shape_x.mesh.num_vertices()),
      features_y_(basis_ + 6, shape_y.mesh.num_vertices()) {
  const AlignmentShape& resting = options_.bend_y ? x_ : y_;
  PointColumns& features = options_.bend_y ? features_x_ : features_y_;
  features.middleRows(basis_, 3) =
      resting.mesh.positions.transpose().cast<float>();
  features.bottomRows(3) =
      (options_.normal_weight * resting.normals.transpose()).cast<float>();
  (options_.bend_y ? features_y_ : features_x_).topRows(basis_) =
      static_cast<float>(options_.spectral_weight) *
      bending().functions.topRows(basis_);
  if (options_.bend_y) {
    StartY();
  } else {
    StartX();
  }
}

void ElasticAlignment::StartX() {
  targets_ = y_.mesh.positions(y_from_x_, Eigen::all);
  pull_ = x_.laplacian.mass;
  bent_.positions = targets_;
}

/// Y as it is, moved rigidly to where the images lie best on X.
void ElasticAlignment::StartY() {
  const Eigen::VectorXd& mass = x_.laplacian.mass;
  const Positions images = y_.mesh.positions(y_from_x_, Eigen::all);
  const Eigen::RowVector3d center_x =
      mass.transpose() * x_.mesh.positions / mass.sum();
  const Eigen::RowVector3d center_y = mass.transpose() * images / mass.sum();
  const Eigen::Matrix3d rotation =
      BestRotation((x_.mesh.positions.rowwise() - center_x).transpose() *
                   mass.asDiagonal() * (images.rowwise() - center_y));
  bent_.positions =
      ((y_.mesh.positions.rowwise() - center_y) * rotation.transpose())
          .rowwise() +
      center_x;
  for (VertexIndex x = 0; x < x_.mesh.num_vertices(); ++x) {
    points_[x] = NearestPoint(x, bent_.positions.row(y_from_x_[x]));
  }
  SetTargetsOfY(0);
}

void ElasticAlignment::Fix(absl::Span<const VertexMatch> landmarks) {
  for (const VertexMatch& landmark : landmarks) {
    fixed_[landmark.x] = landmark.y;
    y_from_x_[landmark.x] = landmark.y;
    if (options_.bend_y) {
      points_[landmark.x] =
          NearestPoint(landmark.x, bent_.positions.row(landmark.y));
    } else {
      targets_.row(landmark.x) = y_.mesh.positions.row(landmark.y);
      pull_[landmark.x] = kLandmarkPull * x_.laplacian.mass[landmark.x];
    }
  }
  if (options_.bend_y) SetTargetsOfY(kOverrelaxation);
}

void ElasticAlignment::DescribeFunctions() {
  if (options_.bend_y) {
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

void ElasticAlignment::DescribeBent() {
  normals_ = VertexNormals(bent_);
  PointColumns& features = options_.bend_y ? features_y_ : features_x_;
  features.middleRows(basis_, 3) = bent_.positions.transpose().cast<float>();
  features.bottomRows(3) =
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

SurfacePoint ElasticAlignment::NearestPoint(
    VertexIndex x, const Eigen::RowVector3d& position) const {
  const VertexIndex y = y_from_x_[x];
  return options_.bend_y
             ? NearestOnFaces(bent_, y_.stars.SomeFaces(y), position)
             : (y_.faces != nullptr ? *y_.faces : own_faces_y_)[y].Nearest(
                   position);
}

absl::Status ElasticAlignment::FindPoints(const std::stop_token& stop) {
  ISOMATCH_RETURN_IF_ERROR(
      ParallelForVertices(x_.mesh.num_vertices(), stop, [&](VertexIndex x) {
        points_[x] = NearestPoint(
            x, fixed_[x] != kNoVertex
                   ? Eigen::RowVector3d(laid_y().positions.row(fixed_[x]))
                   : Eigen::RowVector3d(laid_x().positions.row(x)));
        if (!options_.bend_y) SetTargetOfX(x);
      }));
  if (options_.bend_y) SetTargetsOfY(kOverrelaxation);
  return absl::OkStatus();
}

void ElasticAlignment::SetTargetOfX(VertexIndex x) {
  targets_.row(x) = PositionOf(y_.mesh, points_[x]);
  if (fixed_[x] == kNoVertex) {
    targets_.row(x) +=
        kOverrelaxation * (targets_.row(x) - bent_.positions.row(x));
  }
}

/// Each point of Y pulls the corners of its face its own way.
void ElasticAlignment::SetTargetsOfY(double overrelaxation) {
  pull_ = kUnmatchedPull * y_.laplacian.mass;
  targets_ = pull_.asDiagonal() * bent_.positions;
  for (VertexIndex x = 0; x < x_.mesh.num_vertices(); ++x) {
    const SurfacePoint& point = points_[x];
    const bool fixed = fixed_[x] != kNoVertex;
    const Eigen::RowVector3d way =
        (1 + (fixed ? 0 : overrelaxation)) *
        (x_.mesh.positions.row(x) - PositionOf(bent_, point));
    const double pull = x_.laplacian.mass[x] * (fixed ? kLandmarkPull : 1);
    for (int corner = 0; corner < 3; ++corner) {
      const VertexIndex y = y_.mesh.faces(point.face, corner);
      const double share = pull * point.weights[corner];
      pull_[y] += share;
      targets_.row(y) += share * (bent_.positions.row(y) + way);
    }
  }
  targets_.array().colwise() /= pull_.array();
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
  return Pull(steps, stop);
}

/// Most of Y may lie where X is missing. Nothing pulls it there, and it would
/// follow the rest by a few edges a step: momentum (Nesterov: A method of
/// solving a convex programming problem with convergence rate O(1/k^2), 1983)
/// takes it as far in a hundred steps as a thousand would.
absl::Status ElasticAlignment::Pull(int steps, const std::stop_token& stop) {
  Positions before;
  for (int step = 0; step < steps; ++step) {
    ISOMATCH_RETURN_IF_ERROR(surface_.Step(targets_, stop, &bent_.positions));
    if (!options_.bend_y || step + 1 == steps) continue;
    const Positions now = bent_.positions;
    if (step > 0) bent_.positions += step / (step + 3.0) * (now - before);
    before = now;
  }
  return absl::OkStatus();
}

absl::Status ElasticAlignment::Run(double stiffness, int rounds,
                                   const std::stop_token& stop) {
  for (int round = 0; round < rounds; ++round) {
    // What pulls Y changes with the map; at one stiffness the functional map of
    // whole shapes hardly does.
    const bool changed = round == 0 || options_.bend_y;
    if (changed) ISOMATCH_RETURN_IF_ERROR(surface_.SetPull(pull_, stiffness));
    ISOMATCH_RETURN_IF_ERROR(Pull(kStepsPerRound, stop));
    DescribeBent();
    if (changed) DescribeFunctions();
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
  return (laid_x().positions.row(x) - PositionOf(laid_y(), points_[x])).norm();
}

double ElasticAlignment::NormalMismatch(VertexIndex x) const {
  const Positions& of_x = options_.bend_y ? x_.normals : normals_;
  const Positions& of_y = options_.bend_y ? normals_ : y_.normals;
  return 1 - of_x.row(x).dot(of_y.row(y_from_x_[x]));
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
  score.stretch = surface_.Energy(bent_.positions) / mass.sum();
  return score;
}

}  // namespace isomatch
