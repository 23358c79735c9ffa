#include "core/mesh/embedding.h"

#include <gtest/gtest.h>

#include "core/mesh/decimation.h"
#include "core/mesh/mesh_geometry.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

class EmbeddingTest : public testing::Test {
 protected:
  absl::StatusOr<std::vector<SurfacePoint>> Embed(
      const std::stop_token& stop = {}) const {
    return EmbedInCoarse({fine_, fine_stars_},
                         {coarse_.mesh.faces, VertexStars(coarse_.mesh),
                          coarse_.fine_from_coarse},
                         NearestByEdges(fine_stars_, fine_.num_vertices(),
                                        coarse_.fine_from_coarse),
                         stop);
  }

  const TriangleMesh fine_ = FiveArms(4);
  const VertexStars fine_stars_{fine_};
  const CoarseMesh coarse_ = *Decimate(fine_, 800, {});
};

TEST_F(EmbeddingTest, FindsTheNearestPointOfAllFaces) {
  const auto embedding = Embed();
  ASSERT_THAT(embedding, IsOk());
  std::vector<VertexIndex> all_faces(coarse_.mesh.num_faces());
  for (VertexIndex f = 0; f < coarse_.mesh.num_faces(); ++f) all_faces[f] = f;
  int exact = 0;
  for (VertexIndex v = 0; v < fine_.num_vertices(); ++v) {
    const Eigen::RowVector3d position = fine_.positions.row(v);
    const double found =
        (PositionOf(coarse_.mesh, (*embedding)[v]) - position).norm();
    const double least =
        (PositionOf(coarse_.mesh,
                    NearestOnFaces(coarse_.mesh, all_faces, position)) -
         position)
            .norm();
    ASSERT_GE(found, least - 1e-9);
    exact += found <= least + 1e-9;
  }
  EXPECT_GE(exact, 0.99 * fine_.num_vertices());
}

TEST_F(EmbeddingTest, SharedVerticesLieAtThemselves) {
  const auto embedding = Embed();
  ASSERT_THAT(embedding, IsOk());
  for (const VertexIndex v : coarse_.fine_from_coarse) {
    EXPECT_LT(
        (PositionOf(coarse_.mesh, (*embedding)[v]) - fine_.positions.row(v))
            .norm(),
        1e-7);
  }
}

TEST_F(EmbeddingTest, InItselfEveryVertexIsACorner) {
  const std::vector<SurfacePoint> embedding =
      EmbedInItself({fine_, fine_stars_});
  for (VertexIndex v = 0; v < fine_.num_vertices(); ++v) {
    EXPECT_EQ(PositionOf(fine_, embedding[v]), fine_.positions.row(v));
  }
}

TEST_F(EmbeddingTest, NearestByEdgesIsOneStepFromANeighborsOne) {
  const VertexMap nearest = NearestByEdges(fine_stars_, fine_.num_vertices(),
                                           coarse_.fine_from_coarse);
  for (std::size_t c = 0; c < coarse_.fine_from_coarse.size(); ++c) {
    EXPECT_EQ(nearest[coarse_.fine_from_coarse[c]],
              static_cast<VertexIndex>(c));
  }
  EXPECT_EQ(std::count(nearest.begin(), nearest.end(), kNoVertex), 0);
}

TEST_F(EmbeddingTest, StopsWhenAsked) {
  std::stop_source source;
  source.request_stop();
  EXPECT_THAT(Embed(source.get_token()).status(),
              StatusIs(absl::StatusCode::kCancelled, testing::_));
}

}  // namespace
}  // namespace isomatch
