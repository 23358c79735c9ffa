// A shape of which a part is missing.

#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/evaluation/geodesic_error.h"
#include "core/mesh/mesh_geometry.h"
#include "core/mesh/topology.h"
#include "core/pipeline/matcher.h"
#include "tests/support/dirty_meshes.h"
#include "tests/support/matchers.h"
#include "tests/support/quick_options.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::Contains;
using testing::HasSubstr;

const Eigen::RowVector3d kLongestArm(1, 0.1, 0.05);
const Eigen::RowVector3d kSecondArm(0.2, 1, 0.1);

/// FiveArms, and the same relabeled and moved without one arm.
class PartialTest : public testing::Test {
 protected:
  /// Cuts off what lies beyond `height` along `arm`.
  void CutOff(const Eigen::RowVector3d& arm, double height) {
    part_ = WithoutLoneVertices(
        WithoutFaces(Untouched(whole_), Beyond(arm, height)));
    part_from_whole_.assign(whole_.num_vertices(), kNoVertex);
    const auto permutation =
        RandomPermutation(part_.mesh.num_vertices(), /*seed=*/6);
    part_.mesh = Moved(Relabeled(part_.mesh, permutation), kScale);
    VertexMap origin(part_.origin.size());
    for (std::size_t v = 0; v < origin.size(); ++v) {
      origin[permutation[v]] = part_.origin[v];
      part_from_whole_[part_.origin[v]] = permutation[v];
    }
    part_.origin = origin;
    ASSERT_GT(EdgeFaces(part_.mesh.faces).boundary_edges(), 0);
    ASSERT_EQ(ConnectedComponents(part_.mesh).count, 1);
  }

  /// What was cut off, as a fraction of the whole's area.
  double MissingArea() const {
    return 1 -
           SurfaceArea(part_.mesh) / (kScale * kScale * SurfaceArea(whole_));
  }

  static constexpr double kScale = 3;

  TriangleMesh whole_ = FiveArms(4);
  DirtyMesh part_;
  VertexMap part_from_whole_;
};

/// Mean confidence of the vertices with and of those without a counterpart.
struct MeanConfidence {
  MeanConfidence(const std::vector<float>& confidence, const VertexMap& truth) {
    int counts[2] = {0, 0};
    double sums[2] = {0, 0};
    for (std::size_t v = 0; v < truth.size(); ++v) {
      const bool is_there = truth[v] != kNoVertex;
      sums[is_there] += confidence[v];
      ++counts[is_there];
    }
    missing = sums[0] / counts[0];
    present = sums[1] / counts[1];
  }
  double missing;
  double present;
};

TEST_F(PartialTest, APartIsFoundInTheWholeAndTheRestStaysUncovered) {
  CutOff(kFourthArm, 1.3);
  const auto found = Match(part_.mesh, whole_, {}, QuickOptions());
  ASSERT_THAT(found, IsOk());
  const auto error =
      GeodesicErrorMeter(whole_).Measure(found->y_from_x, part_.origin);
  ASSERT_THAT(error, IsOk());
  EXPECT_LT(error->mean_over_diameter, 0.02);
  EXPECT_GT(error->within[2], 0.95);
  EXPECT_THAT(found->warnings_x, Contains(HasSubstr("open surface")));
  const auto self = Match(whole_, Moved(whole_, 3), {}, QuickOptions());
  ASSERT_THAT(self, IsOk());
  EXPECT_GT(self->quality.coverage, 0.99);
  // The arm's area, less the rim that is within reach.
  const double missing = MissingArea();
  EXPECT_GT(missing, 0.05);
  EXPECT_LT(found->quality.coverage, 1 - missing / 2);
}

TEST_F(PartialTest, WithoutTheLongestArmTooAPartIsFoundInTheWhole) {
  CutOff(kLongestArm, 1.4);
  const auto found = Match(part_.mesh, whole_, {}, QuickOptions());
  ASSERT_THAT(found, IsOk());
  const auto error =
      GeodesicErrorMeter(whole_).Measure(found->y_from_x, part_.origin);
  ASSERT_THAT(error, IsOk());
  EXPECT_LT(error->mean_over_diameter, 0.03);
  EXPECT_GT(error->within[2], 0.9);
  EXPECT_LT(found->quality.coverage, 1 - MissingArea() / 2);
}

TEST_F(PartialTest, VerticesWithoutACounterpartAreNotTrusted) {
  for (const Eigen::RowVector3d& arm : {kFourthArm, kSecondArm}) {
    CutOff(arm, 1.3);
    const auto found = Match(whole_, part_.mesh, {}, QuickOptions());
    ASSERT_THAT(found, IsOk());
    const auto error = GeodesicErrorMeter(part_.mesh)
                           .Measure(found->y_from_x, part_from_whole_);
    ASSERT_THAT(error, IsOk());
    EXPECT_LT(error->mean_over_diameter, 0.03);
    EXPECT_GT(error->within[2], 0.9);
    EXPECT_THAT(found->warnings_y, Contains(HasSubstr("open surface")));
    const MeanConfidence mean(found->confidence, part_from_whole_);
    EXPECT_LT(mean.missing, 0.2);
    EXPECT_GT(mean.present, mean.missing + 0.3);
    // Nothing of the part is left over.
    EXPECT_GT(found->quality.coverage, 0.97);
  }
}

}  // namespace
}  // namespace isomatch
