#include "core/alignment/elastic_alignment.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random_stream.h"
#include "core/mesh/mesh_geometry.h"
#include "core/spectral/functional_map.h"
#include "tests/support/dirty_meshes.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

/// A mesh of area 1 with all that the alignment wants.
struct Prepared {
  explicit Prepared(TriangleMesh shape) : mesh(std::move(shape)) {
    mesh.positions /= std::sqrt(SurfaceArea(mesh));
    normals = VertexNormals(mesh);
    laplacian = BuildCotanLaplacian(mesh);
    functions = FunctionColumns(*ComputeSpectralBasis(laplacian, 40, {}), 40);
    stars = VertexStars(mesh);
  }
  AlignmentShape shape() const {
    return {mesh, normals, laplacian, functions, stars};
  }

  TriangleMesh mesh;
  Positions normals;
  CotanLaplacian laplacian;
  PointColumns functions;
  VertexStars stars;
};

/// A part of `whole`, in the unit in which that has area 1.
Prepared InUnitOf(const TriangleMesh& whole, const TriangleMesh& part) {
  Prepared prepared(part);
  const double scale = std::sqrt(SurfaceArea(part) / SurfaceArea(whole));
  prepared.mesh.positions *= scale;
  prepared.laplacian.mass *= scale * scale;
  prepared.functions /= static_cast<float>(scale);
  return prepared;
}

/// `mesh` bent around an axis: nearly isometric, differently posed.
TriangleMesh Bent(TriangleMesh mesh) {
  for (Eigen::Index v = 0; v < mesh.positions.rows(); ++v) {
    const double angle = 0.25 * mesh.positions(v, 0);
    const double z = mesh.positions(v, 2);
    const double y = mesh.positions(v, 1);
    mesh.positions(v, 1) = std::cos(angle) * y - std::sin(angle) * z;
    mesh.positions(v, 2) = std::sin(angle) * y + std::cos(angle) * z;
  }
  return mesh;
}

double FractionSame(const VertexMap& map) {
  int same = 0;
  for (std::size_t v = 0; v < map.size(); ++v) {
    same += map[v] == static_cast<VertexIndex>(v);
  }
  return double(same) / double(map.size());
}

class ElasticAlignmentTest : public testing::Test {
 protected:
  ElasticAlignmentTest() : x_(FiveArms(3)), y_(Bent(FiveArms(3))) {
    options_.basis = 40;
  }

  /// The identity with every image moved to a vertex near it.
  VertexMap NoisyIdentity() const {
    const VertexStars stars(y_.mesh);
    RandomStream random(1, 1);
    VertexMap map;
    for (VertexIndex v = 0; v < x_.mesh.num_vertices(); ++v) {
      const auto near = stars.Neighbors(v);
      map.push_back(near[random.Below(static_cast<int>(near.size()))]);
    }
    return map;
  }

  const Prepared x_;
  const Prepared y_;
  AlignmentOptions options_;
};

TEST_F(ElasticAlignmentTest, RepairsANoisyMap) {
  const VertexMap noisy = NoisyIdentity();
  ASSERT_LT(FractionSame(noisy), 0.01);
  ElasticAlignment alignment(x_.shape(), y_.shape(), options_, noisy);
  for (const double stiffness : {0.03, 0.01, 0.003}) {
    ASSERT_THAT(alignment.Run(stiffness, 4, {}), IsOk());
  }
  EXPECT_GT(FractionSame(alignment.y_from_x()), 0.8);
  const auto points = alignment.PrecisePoints({});
  ASSERT_THAT(points, IsOk());
  double offset = 0;
  for (VertexIndex v = 0; v < x_.mesh.num_vertices(); ++v) {
    offset +=
        (PositionOf(y_.mesh, (*points)[v]) - y_.mesh.positions.row(v)).norm();
  }
  EXPECT_LT(offset / x_.mesh.num_vertices(), 0.3 * MeanEdgeLength(y_.mesh));
}

TEST_F(ElasticAlignmentTest, FacesThatAreSharedChangeNothing) {
  const std::vector<FaceLanes> faces = FacesAroundVertices(y_.mesh, y_.stars);
  AlignmentShape shares = y_.shape();
  shares.faces = &faces;
  ElasticAlignment alone(x_.shape(), y_.shape(), options_, NoisyIdentity());
  ElasticAlignment sharing(x_.shape(), shares, options_, NoisyIdentity());
  ASSERT_THAT(alone.Run(0.03, 4, {}), IsOk());
  ASSERT_THAT(sharing.Run(0.03, 4, {}), IsOk());
  EXPECT_EQ(sharing.y_from_x(), alone.y_from_x());
  for (VertexIndex v = 0; v < x_.mesh.num_vertices(); ++v) {
    EXPECT_EQ(sharing.Residual(v), alone.Residual(v));
  }
}

TEST_F(ElasticAlignmentTest, EitherShapeCanBeBent) {
  options_.bend_y = true;
  ElasticAlignment alignment(x_.shape(), y_.shape(), options_, NoisyIdentity());
  for (const double stiffness : {0.03, 0.01, 0.003}) {
    ASSERT_THAT(alignment.Run(stiffness, 4, {}), IsOk());
  }
  EXPECT_GT(FractionSame(alignment.y_from_x()), 0.7);
  double residual = 0;
  for (VertexIndex v = 0; v < x_.mesh.num_vertices(); ++v) {
    residual += alignment.Residual(v);
  }
  EXPECT_LT(residual / x_.mesh.num_vertices(), 0.1 * MeanEdgeLength(y_.mesh));
}

TEST_F(ElasticAlignmentTest, APartIsFoundWhereTheWholeIsBent) {
  const TriangleMesh body = FiveArms(3);
  const DirtyMesh part = WithoutLoneVertices(
      WithoutFaces(Untouched(body), Beyond({1, 0, 0}, 0.2)));
  const Prepared y(Bent(body));
  const Prepared x = InUnitOf(body, part.mesh);
  VertexMap noisy;
  RandomStream random(1, 1);
  for (const VertexIndex v : part.origin) {
    const auto near = y.stars.Neighbors(v);
    noisy.push_back(near[random.Below(static_cast<int>(near.size()))]);
  }
  options_.bend_y = true;
  ElasticAlignment alignment(x.shape(), y.shape(), options_, noisy);
  ASSERT_THAT(alignment.Settle(0.03, 30, {}), IsOk());
  for (const double stiffness : {0.03, 0.01, 0.003}) {
    ASSERT_THAT(alignment.Run(stiffness, 4, {}), IsOk());
  }
  const auto points = alignment.PrecisePoints({});
  ASSERT_THAT(points, IsOk());
  double offset = 0;
  for (std::size_t v = 0; v < noisy.size(); ++v) {
    offset += (PositionOf(y.mesh, (*points)[v]) -
               y.mesh.positions.row(part.origin[v]))
                  .norm();
  }
  EXPECT_LT(offset / static_cast<double>(noisy.size()),
            0.4 * MeanEdgeLength(y.mesh));
}

TEST_F(ElasticAlignmentTest, WhatNothingPullsSoonFollowsTheRest) {
  // Y is a long body, X both ends of it in another pose.
  TriangleMesh straight = UnitSphere(4);
  straight.positions.col(2) *= 6;
  TriangleMesh curved = straight;
  for (auto row : curved.positions.rowwise()) {
    const double angle = row[2] / 6;
    const double radius = 6 + row[0];
    row = Eigen::RowVector3d(radius * std::cos(angle), row[1],
                             radius * std::sin(angle));
  }
  const DirtyMesh ends = WithoutLoneVertices(
      WithoutFaces(Untouched(curved), [&](const auto&, VertexIndex f) {
        return std::abs(straight.positions(straight.faces(f, 0), 2)) < 3;
      }));
  const Prepared y(straight);
  const Prepared x = InUnitOf(curved, ends.mesh);
  options_.bend_y = true;
  const auto stretch = [&](int steps) {
    ElasticAlignment alignment(x.shape(), y.shape(), options_, ends.origin);
    EXPECT_THAT(alignment.Settle(0.03, steps, {}), IsOk());
    EXPECT_THAT(alignment.Run(0.03, 1, {}), IsOk());
    return alignment.Score().stretch;
  };
  EXPECT_LT(stretch(100), 1.1 * stretch(1000));
}

TEST_F(ElasticAlignmentTest, TheWholeTellsWherePiecesOfAPartDoNotBelong) {
  // X is the body with a gap in one arm, and what lies beyond the gap is sent
  // to another arm of Y, which already has a counterpart, or to where it
  // belongs.
  const Eigen::RowVector3d arm(0.99, 0.1, 0.05);
  const TriangleMesh body = FiveArms(4);
  const DirtyMesh part = WithoutLoneVertices(
      WithoutFaces(Untouched(body), [&](const auto& mesh, VertexIndex f) {
        const double height = mesh.positions(mesh.faces.row(f), Eigen::all)
                                  .colwise()
                                  .mean()
                                  .dot(arm);
        return height > 1.1 && height < 1.4;
      }));
  const Prepared y(Bent(body));
  const Prepared x = InUnitOf(body, part.mesh);
  const Eigen::Matrix3d turn = Eigen::Quaterniond::FromTwoVectors(
                                   arm.transpose(), kFourthArm.transpose())
                                   .toRotationMatrix();
  VertexMap wrong = part.origin;
  for (VertexIndex& image : wrong) {
    const Eigen::RowVector3d place = body.positions.row(image);
    if (place.dot(arm) < 1.3) continue;
    (body.positions.rowwise() - place * turn.transpose())
        .rowwise()
        .norm()
        .minCoeff(&image);
  }
  double times_worse[2];
  for (const bool bend_y : {false, true}) {
    options_.bend_y = bend_y;
    const auto stretch = [&](const VertexMap& map) {
      ElasticAlignment alignment(x.shape(), y.shape(), options_, map);
      if (bend_y) {
        EXPECT_THAT(alignment.Settle(0.03, 30, {}), IsOk());
      }
      EXPECT_THAT(alignment.Run(0.03, 2, {}), IsOk());
      return alignment.Score().stretch;
    };
    times_worse[bend_y] = stretch(wrong) / stretch(part.origin);
  }
  EXPECT_GT(times_worse[true], 20);
  EXPECT_GT(times_worse[true], 5 * times_worse[false]);
}

TEST_F(ElasticAlignmentTest, ScoresTellARightMapFromAReflectedOne) {
  // Of a mirror-symmetric body both are isometries.
  const Prepared body(MirrorSymmetricBody(3));
  VertexMap identity;
  VertexMap reflection;
  for (VertexIndex v = 0; v < body.mesh.num_vertices(); ++v) {
    identity.push_back(v);
    Eigen::RowVector3d mirrored = body.mesh.positions.row(v);
    mirrored[2] *= -1;
    Eigen::Index image;
    (body.mesh.positions.rowwise() - mirrored)
        .rowwise()
        .norm()
        .minCoeff(&image);
    reflection.push_back(static_cast<VertexIndex>(image));
  }
  ElasticAlignment right(body.shape(), body.shape(), options_, identity);
  ElasticAlignment wrong(body.shape(), body.shape(), options_, reflection);
  ASSERT_THAT(right.Run(0.03, 4, {}), IsOk());
  ASSERT_THAT(wrong.Run(0.03, 4, {}), IsOk());
  EXPECT_NEAR(right.Score().normal_mismatch, 0, 1e-3);
  EXPECT_NEAR(right.Score().stretch, 0, 1e-3);
  EXPECT_GT(wrong.Score().normal_mismatch, 10 * right.Score().normal_mismatch);
}

TEST_F(ElasticAlignmentTest, FixedLandmarksStay) {
  const std::vector<VertexMatch> landmarks = {{5, 9}, {100, 100}};
  for (const bool bend_y : {false, true}) {
    options_.bend_y = bend_y;
    ElasticAlignment alignment(x_.shape(), y_.shape(), options_,
                               NoisyIdentity());
    alignment.Fix(landmarks);
    ASSERT_THAT(alignment.Run(0.01, 5, {}), IsOk());
    const auto points = alignment.PrecisePoints({});
    ASSERT_THAT(points, IsOk());
    for (const VertexMatch& landmark : landmarks) {
      EXPECT_EQ(alignment.y_from_x()[landmark.x], landmark.y);
      EXPECT_LT((PositionOf(y_.mesh, (*points)[landmark.x]) -
                 y_.mesh.positions.row(landmark.y))
                    .norm(),
                1e-9);
    }
  }
}

TEST_F(ElasticAlignmentTest, StopsWhenAsked) {
  ElasticAlignment alignment(x_.shape(), y_.shape(), options_, NoisyIdentity());
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THAT(alignment.Run(0.01, 5, stop.get_token()),
              StatusIs(absl::StatusCode::kCancelled, testing::_));
}

}  // namespace
}  // namespace isomatch
