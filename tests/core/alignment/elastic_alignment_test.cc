#include "core/alignment/elastic_alignment.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random_stream.h"
#include "core/mesh/mesh_geometry.h"
#include "core/spectral/functional_map.h"
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

TEST_F(ElasticAlignmentTest, EitherShapesFunctionsCanBeCarried) {
  options_.carry_x = true;
  ElasticAlignment alignment(x_.shape(), y_.shape(), options_, NoisyIdentity());
  for (const double stiffness : {0.03, 0.01, 0.003}) {
    ASSERT_THAT(alignment.Run(stiffness, 4, {}), IsOk());
  }
  EXPECT_GT(FractionSame(alignment.y_from_x()), 0.8);
}

TEST_F(ElasticAlignmentTest, OfAPartItsOwnFunctionsAreCarried) {
  // Without the faces beyond a height; its vertices come first on the whole.
  TriangleMesh whole = FiveArms(3);
  std::vector<VertexIndex> order;
  for (const bool kept : {true, false}) {
    for (VertexIndex v = 0; v < whole.num_vertices(); ++v) {
      if ((whole.positions(v, 0) < 0.2) == kept) order.push_back(v);
    }
  }
  VertexMap new_from_old(order.size());
  for (std::size_t v = 0; v < order.size(); ++v) {
    new_from_old[order[v]] = static_cast<VertexIndex>(v);
  }
  whole = Relabeled(whole, new_from_old);
  const Prepared y(Bent(whole));
  TriangleMesh part;
  std::vector<VertexIndex> faces;
  VertexIndex vertices = 0;
  for (VertexIndex f = 0; f < whole.num_faces(); ++f) {
    const auto corners = whole.faces.row(f);
    if (!(whole.positions(corners, 0).array() < 0.2).all()) continue;
    faces.push_back(f);
    vertices = std::max(vertices, corners.maxCoeff() + 1);
  }
  part.faces = whole.faces(faces, Eigen::all);
  part.positions = whole.positions.topRows(vertices);
  Prepared x(part);
  // Prepared has made the area 1; back to the whole's unit.
  const double scale = std::sqrt(SurfaceArea(part) / SurfaceArea(whole));
  x.mesh.positions *= scale;
  x.laplacian.mass *= scale * scale;
  x.functions /= static_cast<float>(scale);
  VertexMap noisy;
  const VertexStars stars(y.mesh);
  RandomStream random(1, 1);
  for (VertexIndex v = 0; v < vertices; ++v) {
    const auto near = stars.Neighbors(v);
    noisy.push_back(near[random.Below(static_cast<int>(near.size()))]);
  }
  double same[2];
  for (const bool carry_x : {false, true}) {
    options_.carry_x = carry_x;
    ElasticAlignment alignment(x.shape(), y.shape(), options_, noisy);
    for (const double stiffness : {0.03, 0.01, 0.003}) {
      ASSERT_THAT(alignment.Run(stiffness, 4, {}), IsOk());
    }
    same[carry_x] = FractionSame(alignment.y_from_x());
  }
  EXPECT_GT(same[true], 0.7);
  EXPECT_GT(same[true], same[false]);
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
  ElasticAlignment alignment(x_.shape(), y_.shape(), options_, NoisyIdentity());
  const std::vector<VertexMatch> landmarks = {{5, 9}, {100, 100}};
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

TEST_F(ElasticAlignmentTest, StopsWhenAsked) {
  ElasticAlignment alignment(x_.shape(), y_.shape(), options_, NoisyIdentity());
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THAT(alignment.Run(0.01, 5, stop.get_token()),
              StatusIs(absl::StatusCode::kCancelled, testing::_));
}

}  // namespace
}  // namespace isomatch
