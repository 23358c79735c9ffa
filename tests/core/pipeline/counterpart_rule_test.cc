#include "core/pipeline/counterpart_rule.h"

#include <algorithm>
#include <array>
#include <stop_token>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "core/mesh/clean_mesh.h"
#include "core/pipeline/preparation.h"
#include "core/pipeline/progress_reporter.h"
#include "core/pipeline/stage_plan.h"
#include "core/spectral/functional_map.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

/// A star laid on itself, with one arm where another one is.
class CounterpartRuleTest : public testing::Test {
 protected:
  explicit CounterpartRuleTest(TriangleMesh mesh = FiveArms(4))
      : laid_(std::move(mesh)) {}

  void SetUp() override {
    ProgressReporter progress({}, StagePlan(options_));
    ASSERT_THAT(
        PrepareMeshes({MeshToPrepare{Clean(laid_, {}).value(), "mesh_x"},
                       MeshToPrepare{Clean(laid_, {}).value(), "mesh_y"}},
                      options_, &progress, {}, &prepared_),
        IsOk());
    functions_ = FunctionColumns(solved_x().spectral, kBasis);
  }

  const PreparedMesh& solved_x() const { return prepared_[kX]; }
  const TriangleMesh& mesh() const { return solved_x().solved().mesh; }

  /// Both are prepared alike, so that this is also the numbering of Y.
  VertexMap Identity() const { return IdentityMap(mesh().num_vertices()); }

  /// Not 0 for the vertices of the fourth arm.
  std::vector<char> InArm() const {
    std::vector<char> in_arm;
    in_arm.reserve(mesh().num_vertices());
    for (VertexIndex v = 0; v < mesh().num_vertices(); ++v) {
      in_arm.push_back(mesh().positions.row(v).dot(kFourthArm.normalized()) >
                       0.22);
    }
    return in_arm;
  }

  /// As the vertices are, but for the fourth arm, which is turned onto the
  /// first one.
  VertexMap WithArmElsewhere() const {
    const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(
        kFourthArm.transpose(), Eigen::Vector3d(1, 0.1, 0.05));
    const std::vector<char> in_arm = InArm();
    VertexMap map = Identity();
    for (VertexIndex& y : map) {
      if (!in_arm[y]) continue;
      const Eigen::RowVector3d place =
          (turn * mesh().positions.row(y).transpose()).transpose();
      (mesh().positions.rowwise() - place).rowwise().squaredNorm().minCoeff(&y);
    }
    return map;
  }

  ElasticAlignment Laid(VertexMap map) const {
    const WorkingMesh& solved = solved_x().solved();
    const AlignmentShape shape = {solved.mesh, solved.normals,
                                  solved_x().laplacian, functions_,
                                  solved.stars};
    return ElasticAlignment(shape, shape, {.basis = kBasis}, std::move(map));
  }

  CounterpartRule Rule() const {
    CounterpartRule rule(prepared_[kX], prepared_[kY], {});
    EXPECT_THAT(rule.SolveSources(), IsOk());
    return rule;
  }

  std::vector<char> All() const {
    return std::vector<char>(mesh().num_vertices(), 1);
  }

  static constexpr int kBasis = 10;
  const TriangleMesh laid_;
  MatchOptions options_;
  std::array<PreparedMesh, 2> prepared_;
  PointColumns functions_;
};

TEST_F(CounterpartRuleTest, WhatKeepsItsDistancesStays) {
  std::vector<char> matched = All();
  ASSERT_THAT(Rule().LeaveOutContradicting(Laid(Identity()), &matched), IsOk());
  EXPECT_THAT(matched, testing::Each(1));
}

TEST_F(CounterpartRuleTest, AnArmThatLiesOnAnotherOneIsLeftOut) {
  const std::vector<char> in_arm = InArm();
  const auto arm = std::count(in_arm.begin(), in_arm.end(), 1);
  ASSERT_GT(arm, mesh().num_vertices() / 40);
  ASSERT_LT(arm, mesh().num_vertices() / 4);
  std::vector<char> matched = All();
  ASSERT_THAT(Rule().LeaveOutContradicting(Laid(WithArmElsewhere()), &matched),
              IsOk());
  int kept = 0;
  int lost = 0;
  for (VertexIndex v = 0; v < mesh().num_vertices(); ++v) {
    kept += in_arm[v] && matched[v];
    lost += !in_arm[v] && !matched[v];
  }
  EXPECT_LT(kept, 0.05 * static_cast<double>(arm));
  EXPECT_EQ(lost, 0);
}

TEST_F(CounterpartRuleTest, WhatHasNoCounterpartIsNotAsked) {
  const std::vector<char> in_arm = InArm();
  std::vector<char> matched = in_arm;
  ASSERT_THAT(Rule().LeaveOutContradicting(Laid(WithArmElsewhere()), &matched),
              IsOk());
  EXPECT_EQ(matched, in_arm);  // in itself an arm is as long as before
  matched.assign(matched.size(), 0);
  ASSERT_THAT(Rule().LeaveOutContradicting(Laid(Identity()), &matched), IsOk());
  EXPECT_THAT(matched, testing::Each(0));
}

TEST_F(CounterpartRuleTest, MisfitIsThatOfWhatIsMatched) {
  CounterpartRule rule = Rule();
  ElasticAlignment laid = Laid(WithArmElsewhere());
  std::vector<char> matched = All();
  laid.SetMatched(matched);
  const auto before = rule.Misfit(laid);
  ASSERT_THAT(before, IsOk());
  EXPECT_GT(before->distortion, 0.01);
  EXPECT_EQ(before->open_border, 0);
  ASSERT_THAT(rule.LeaveOutContradicting(laid, &matched), IsOk());
  laid.SetMatched(matched);
  const auto after = rule.Misfit(laid);
  ASSERT_THAT(after, IsOk());
  EXPECT_LT(after->distortion, 0.003);
  EXPECT_GT(after->open_border, 0.5);  // where the arm begins
}

/// A square with a rim, laid on itself.
class SmoothedMaskTest : public CounterpartRuleTest {
 protected:
  SmoothedMaskTest() : CounterpartRuleTest(PlaneGrid(30, 30, 1, 1)) {}

  /// 1 for the vertices within `radius` of the middle.
  std::vector<char> InDisk(double radius) const {
    const Eigen::RowVector3d middle = mesh().positions.colwise().mean();
    std::vector<char> mask;
    mask.reserve(mesh().num_vertices());
    for (VertexIndex v = 0; v < mesh().num_vertices(); ++v) {
      mask.push_back((mesh().positions.row(v) - middle).norm() < radius);
    }
    return mask;
  }

  /// 1 for those nearer than `width` to one side.
  std::vector<char> InStrip(double width) const {
    const double side = mesh().positions.col(0).minCoeff();
    std::vector<char> mask;
    mask.reserve(mesh().num_vertices());
    for (VertexIndex v = 0; v < mesh().num_vertices(); ++v) {
      mask.push_back(mesh().positions(v, 0) - side < width);
    }
    return mask;
  }

  static std::vector<char> Inverted(std::vector<char> mask) {
    for (char& entry : mask) entry = entry ? 0 : 1;
    return mask;
  }

  static std::vector<char> Either(std::vector<char> a,
                                  const std::vector<char>& b) {
    for (std::size_t v = 0; v < a.size(); ++v) a[v] = a[v] || b[v];
    return a;
  }

  std::vector<char> Smoothed(std::vector<char> mask) const {
    Rule().Smooth(Laid(Identity()), &mask);
    return mask;
  }
};

TEST_F(SmoothedMaskTest, AGapWhereYGoesOnIsFilled) {
  EXPECT_THAT(Smoothed(Inverted(InDisk(0.15))), testing::Each(1));
  EXPECT_THAT(Smoothed(Inverted(InStrip(0.09))), testing::Each(1));
}

TEST_F(SmoothedMaskTest, WhatIsLargeStaysOut) {
  const std::vector<char> mask = Inverted(InDisk(0.22));
  EXPECT_EQ(Smoothed(mask), mask);
  EXPECT_THAT(Smoothed(std::vector<char>(mask.size(), 0)), testing::Each(0));
}

TEST_F(SmoothedMaskTest, WhatLiesBeyondTheRimOfYStaysOut) {
  const std::vector<char> mask = Inverted(InStrip(0.03));
  EXPECT_EQ(Smoothed(mask), mask);
}

TEST_F(SmoothedMaskTest, SpecksAreLeftOut) {
  const std::vector<char> strip = InStrip(0.3);
  std::vector<char> mask = Either(strip, InDisk(0.07));
  ASSERT_NE(mask, strip);
  EXPECT_EQ(Smoothed(mask), strip);
  mask = Either(strip, InDisk(0.15));
  EXPECT_EQ(Smoothed(mask), mask);
}

TEST_F(SmoothedMaskTest, AllThatIsMatchedIsNoSpeck) {
  const std::vector<char> mask = InDisk(0.07);
  EXPECT_EQ(Smoothed(mask), mask);
}

TEST_F(CounterpartRuleTest, Cancels) {
  const auto is_cancelled = StatusIs(absl::StatusCode::kCancelled, testing::_);
  std::stop_source stop;
  CounterpartRule rule(prepared_[kX], prepared_[kY], stop.get_token());
  ASSERT_THAT(rule.SolveSources(), IsOk());
  stop.request_stop();
  EXPECT_THAT(rule.SolveSources(), is_cancelled);
  std::vector<char> matched = All();
  EXPECT_THAT(rule.LeaveOutContradicting(Laid(Identity()), &matched),
              is_cancelled);
}

}  // namespace
}  // namespace isomatch
