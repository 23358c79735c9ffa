#include "core/pipeline/lifting.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/mesh/mesh_geometry.h"
#include "core/mesh/precise_point.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/matcher.h"
#include "tests/support/matchers.h"
#include "tests/support/quick_options.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

/// A shape and the same moved, both decimated, each on its own vertices.
class LiftingTest : public testing::Test {
 protected:
  static PreparedMesh Prepared(const TriangleMesh& mesh) {
    MatchOptions options;
    options.solved_vertices = 700;
    PreparedMesh prepared;
    EXPECT_THAT(PrepareSurface(Clean(mesh), options, {}, &prepared), IsOk());
    EXPECT_TRUE(prepared.coarse.has_value());
    return prepared;
  }

  /// For each solved vertex of x_ the true place on the solved surface of y_:
  /// that of the same user's vertex.
  std::vector<SurfacePoint> TruePoints() const {
    std::vector<SurfacePoint> points;
    for (const VertexIndex user : x_.solved().user_from_working) {
      points.push_back(y_.coarse->embedding[y_.full.working_from_user[user]]);
    }
    return points;
  }

  /// Mean distance of the lifted places from the true ones, in mean edges.
  double ErrorOf(const LiftedMap& lifted) const {
    double sum = 0;
    for (VertexIndex v = 0; v < x_.full.mesh.num_vertices(); ++v) {
      const VertexIndex user = x_.full.user_from_working[v];
      sum += (PositionOf(y_.full.mesh, lifted.points[v]) -
              y_.full.mesh.positions.row(y_.full.working_from_user[user]))
                 .norm();
    }
    return sum / x_.full.mesh.num_vertices() / MeanEdgeLength(y_.full.mesh);
  }

  const PreparedMesh x_ = Prepared(FiveArms(4));
  const PreparedMesh y_ = Prepared(Moved(FiveArms(4), 3));
};

TEST_F(LiftingTest, CarriesTheTruthToAllVertices) {
  const auto lifted = LiftMap(x_, y_, TruePoints(), {}, {});
  ASSERT_THAT(lifted, IsOk());
  EXPECT_LT(ErrorOf(*lifted), 0.2);
  for (VertexIndex v = 0; v < x_.full.mesh.num_vertices(); ++v) {
    const SurfacePoint& point = lifted->points[v];
    EXPECT_GE(point.weights.minCoeff(), 0);
    EXPECT_NEAR(point.weights.sum(), 1, 1e-9);
  }
}

TEST_F(LiftingTest, WorksToAndFromAMeshThatIsNotDecimated) {
  PreparedMesh whole;
  ASSERT_THAT(PrepareSurface(Clean(FiveArms(4)), MatchOptions(), {}, &whole),
              IsOk());
  ASSERT_FALSE(whole.coarse.has_value());
  VertexMap own;
  for (const VertexIndex user : x_.solved().user_from_working) {
    own.push_back(whole.full.working_from_user[user]);
  }
  const auto to_whole =
      LiftMap(x_, whole, PointsAtVertices(whole.full, own), {}, {});
  ASSERT_THAT(to_whole, IsOk());
  int same = 0;
  for (VertexIndex v = 0; v < x_.full.mesh.num_vertices(); ++v) {
    same += whole.full.user_from_working[to_whole->y_from_x[v]] ==
            x_.full.user_from_working[v];
  }
  EXPECT_GE(same, 0.9 * x_.full.mesh.num_vertices());
  const std::vector<SurfacePoint>& places = x_.coarse->embedding;
  std::vector<SurfacePoint> from_whole_points;
  for (const VertexIndex user : whole.full.user_from_working) {
    from_whole_points.push_back(places[x_.full.working_from_user[user]]);
  }
  const auto from_whole = LiftMap(whole, x_, from_whole_points, {}, {});
  ASSERT_THAT(from_whole, IsOk());
  same = 0;
  for (VertexIndex v = 0; v < whole.full.mesh.num_vertices(); ++v) {
    same += x_.full.user_from_working[from_whole->y_from_x[v]] ==
            whole.full.user_from_working[v];
  }
  EXPECT_GE(same, 0.9 * whole.full.mesh.num_vertices());
}

TEST_F(LiftingTest, LandmarksAreMetAndTakeTheirSurroundingsAlong) {
  const auto before = LiftMap(x_, y_, TruePoints(), {}, {});
  ASSERT_THAT(before, IsOk());
  const VertexIndex x = 1000;
  const VertexIndex next = x_.full.stars.Neighbors(x).front();
  // Three edges off where the map goes.
  VertexIndex y = before->y_from_x[x];
  for (int step = 0; step < 3; ++step) y = y_.full.stars.Neighbors(y).back();
  const auto after = LiftMap(x_, y_, TruePoints(), {{{x, y}}}, {});
  ASSERT_THAT(after, IsOk());
  EXPECT_EQ(after->y_from_x[x], y);
  const Eigen::RowVector3d pulled =
      PositionOf(y_.full.mesh, after->points[next]) -
      PositionOf(y_.full.mesh, before->points[next]);
  const Eigen::RowVector3d move = y_.full.mesh.positions.row(y) -
                                  PositionOf(y_.full.mesh, before->points[x]);
  EXPECT_GT(pulled.dot(move), 0.2 * move.squaredNorm());
  EXPECT_LT(ErrorOf(*after), 0.3);  // and nothing far away
}

TEST_F(LiftingTest, StopsWhenAsked) {
  std::stop_source source;
  source.request_stop();
  EXPECT_THAT(LiftMap(x_, y_, TruePoints(), {}, source.get_token()).status(),
              StatusIs(absl::StatusCode::kCancelled, testing::_));
}

/// Match on meshes that are decimated.
class DecimatedMatchTest : public testing::Test {
 protected:
  static MatchOptions Options() {
    MatchOptions options = QuickOptions();
    options.solved_vertices = 800;
    return options;
  }

  const TriangleMesh x_ = FiveArms(4);
  const TriangleMesh y_ = Moved(FiveArms(4), 3);
};

TEST_F(DecimatedMatchTest, FindsTheIdentity) {
  const auto found = Match(x_, y_, {}, Options());
  ASSERT_THAT(found, IsOk());
  ASSERT_EQ(found->y_from_x.size(),
            static_cast<std::size_t>(x_.num_vertices()));
  ASSERT_EQ(found->confidence.size(), found->y_from_x.size());
  ASSERT_EQ(found->precise.size(), found->y_from_x.size());
  double error = 0;
  for (VertexIndex v = 0; v < x_.num_vertices(); ++v) {
    const PrecisePoint& point = found->precise[v];
    Eigen::RowVector3d place = Eigen::RowVector3d::Zero();
    for (int corner = 0; corner < 3; ++corner) {
      place += point.weights[corner] * y_.positions.row(point.vertices[corner]);
    }
    error += (place - y_.positions.row(v)).norm();
  }
  EXPECT_LT(error / x_.num_vertices(), 1.5 * MeanEdgeLength(y_));
  EXPECT_EQ(found->quality.unmatched, 0);
}

TEST_F(DecimatedMatchTest, IsTheSameAtAnyThreadCount) {
  MatchOptions options = Options();
  options.threads = 1;
  const auto one = Match(x_, y_, {}, options);
  options.threads = 3;
  const auto three = Match(x_, y_, {}, options);
  ASSERT_THAT(one, IsOk());
  ASSERT_THAT(three, IsOk());
  EXPECT_EQ(one->y_from_x, three->y_from_x);
  EXPECT_EQ(one->confidence, three->confidence);
}

TEST_F(DecimatedMatchTest, ExactLandmarksAreMetWhereverTheyLie) {
  MatchOptions options = Options();
  options.landmarks_exact = true;
  std::vector<Landmark> landmarks;
  for (VertexIndex v = 7; v < x_.num_vertices(); v += 50) {
    landmarks.push_back({v, v});
  }
  const auto found = Match(x_, y_, landmarks, options);
  ASSERT_THAT(found, IsOk());
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    EXPECT_TRUE(found->landmarks[i].kept);
    EXPECT_EQ(found->y_from_x[landmarks[i].x], landmarks[i].y);
  }
}

TEST_F(DecimatedMatchTest, AFewLandmarksChooseTheMirroredMap) {
  // As users ask for it: left to right by landmarks alone.
  const TriangleMesh body = MirrorSymmetricBody(4);
  std::vector<Landmark> landmarks;
  VertexMap mirrored(body.num_vertices());
  for (VertexIndex v = 0; v < body.num_vertices(); ++v) {
    Eigen::RowVector3d place = body.positions.row(v);
    place[2] *= -1;
    Eigen::Index image;
    (body.positions.rowwise() - place).rowwise().norm().minCoeff(&image);
    mirrored[v] = static_cast<VertexIndex>(image);
  }
  for (VertexIndex v = 0; v < body.num_vertices(); v += 200) {
    landmarks.push_back({v, mirrored[v]});
  }
  MatchOptions options = Options();
  options.landmarks_exact = true;
  const auto found = Match(body, body, landmarks, options);
  ASSERT_THAT(found, IsOk());
  EXPECT_LT(found->scores.orientation_score, 0);
  double error = 0;
  for (VertexIndex v = 0; v < body.num_vertices(); ++v) {
    error += (body.positions.row(found->y_from_x[v]) -
              body.positions.row(mirrored[v]))
                 .norm();
  }
  EXPECT_LT(error / body.num_vertices(), 3 * MeanEdgeLength(body));
}

TEST_F(DecimatedMatchTest, AWrongLandmarkNextToARightOneIsNotKept) {
  // Both share a vertex of the decimated mesh.
  MatchOptions options = Options();
  PreparedMesh prepared;
  ASSERT_THAT(PrepareSurface(Clean(x_), options, {}, &prepared), IsOk());
  const VertexMap& solved = prepared.solved().working_from_user;
  VertexIndex other = 1;
  while (other == 0 || solved[other] != solved[0]) ++other;
  Eigen::Index far = 0;
  (x_.positions.rowwise() - x_.positions.row(0))
      .rowwise()
      .norm()
      .maxCoeff(&far);
  const std::vector<Landmark> landmarks = {
      {0, 0}, {other, static_cast<VertexIndex>(far)}};
  const auto found = Match(x_, y_, landmarks, options);
  ASSERT_THAT(found, IsOk());
  EXPECT_TRUE(found->landmarks[0].kept);
  EXPECT_FALSE(found->landmarks[1].kept);
  EXPECT_NE(found->y_from_x[other], static_cast<VertexIndex>(far));
}

TEST_F(DecimatedMatchTest, AnOpenSheetKeepsTheSideItFaces) {
  // Its enclosed volume is next to nothing: cleaning may turn either level.
  TriangleMesh sheet = PlaneGrid(60, 50, 3, 2);
  for (VertexIndex v = 0; v < sheet.num_vertices(); ++v) {
    sheet.positions(v, 2) = 0.1 * std::sin(3 * sheet.positions(v, 0)) *
                            std::cos(2 * sheet.positions(v, 1));
  }
  PreparedMesh prepared;
  ASSERT_THAT(PrepareSurface(Clean(sheet), Options(), {}, &prepared), IsOk());
  ASSERT_TRUE(prepared.coarse.has_value());
  const WorkingMesh& solved = prepared.solved();
  for (VertexIndex v = 0; v < solved.mesh.num_vertices(); ++v) {
    EXPECT_GT(solved.normals.row(v).dot(prepared.full.normals.row(
                  prepared.coarse->full_from_coarse[v])),
              0.5);
  }
}

}  // namespace
}  // namespace isomatch
