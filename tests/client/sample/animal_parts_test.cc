// Parts of the sample animal in two poses, each with a triangulation of its
// own: what a user without data of theirs sees of relations.

#include <algorithm>
#include <cmath>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/sample/sample_animal.h"
#include "core/evaluation/geodesic_error.h"
#include "core/evaluation/overlap_iou.h"
#include "core/mesh/mesh_geometry.h"
#include "core/pipeline/confidence.h"
#include "core/pipeline/matcher.h"
#include "tests/support/dirty_meshes.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

/// Pose A without one end, pose B without the other.
class AnimalPartsTest : public testing::Test {
 protected:
  AnimalPartsTest() {
    const VertexMap b_from_a = SampleTruth(a_, b_);
    x_ = Where(a_, [](double along) { return along < 0.8; });
    y_ = Where(b_, [](double along) { return along > 0.35; });
    VertexMap y_of_b(b_.mesh.num_vertices(), kNoVertex);
    for (std::size_t v = 0; v < y_.origin.size(); ++v) {
      y_of_b[y_.origin[v]] = static_cast<VertexIndex>(v);
    }
    for (const VertexIndex v : x_.origin) truth_.push_back(y_of_b[b_from_a[v]]);
    for (const VertexIndex v : b_from_a) y_from_whole_.push_back(y_of_b[v]);
  }

  static Sample Animal(char pose, int vertices) {
    SampleOptions options;
    options.pose = pose;
    options.vertices = vertices;
    return *MakeSample(options);
  }

  /// What lies so far along the animal at rest, 0 to 1, whatever its pose.
  template <typename Keep>
  static DirtyMesh Where(const Sample& animal, const Keep& keep) {
    const double low = animal.rest.col(0).minCoeff();
    const double length = animal.rest.col(0).maxCoeff() - low;
    const auto keeps = [&, low, length](VertexIndex v) {
      return keep((animal.rest(v, 0) - low) / length);
    };
    return WithoutLoneVertices(WithoutFaces(
        Untouched(animal.mesh), [&](const TriangleMesh& mesh, VertexIndex f) {
          return !keeps(mesh.faces(f, 0)) || !keeps(mesh.faces(f, 1)) ||
                 !keeps(mesh.faces(f, 2));
        }));
  }

  double ErrorOf(const VertexMap& map, const VertexMap& truth) const {
    return GeodesicErrorMeter(y_.mesh).Measure(map, truth)->mean_over_diameter;
  }
  static double IouOf(const TriangleMesh& mesh, const VertexMap& map,
                      const VertexMap& truth) {
    return OverlapIou(map, truth, {}, VertexAreas(mesh)).value_or(1);
  }

  Sample a_ = Animal('A', 3000);
  Sample b_ = Animal('B', 2600);
  DirtyMesh x_;
  DirtyMesh y_;
  VertexMap truth_;         ///< from x_ to y_
  VertexMap y_from_whole_;  ///< from all of A
};

TEST_F(AnimalPartsTest, TwoPartsAreMatchedWhereTheyOverlap) {
  const auto shared =
      truth_.size() - static_cast<std::size_t>(
                          std::count(truth_.begin(), truth_.end(), kNoVertex));
  ASSERT_LT(double(shared), 0.9 * double(truth_.size()));
  MatchOptions options;
  options.relation = Relation::kOverlap;
  options.scale = LengthScale::kSame;
  const auto found = Match(x_.mesh, y_.mesh, {}, options);
  ASSERT_THAT(found, IsOk());
  const double error = ErrorOf(found->y_from_x, truth_);
  EXPECT_LT(error, 0.02);
  EXPECT_GT(IouOf(x_.mesh, found->y_from_x, truth_), 0.9);
  // As wholes they match worse.
  const auto as_wholes = Match(x_.mesh, y_.mesh, {}, MatchOptions());
  ASSERT_THAT(as_wholes, IsOk());
  EXPECT_GT(ErrorOf(as_wholes->y_from_x, truth_), 1.2 * error);
}

TEST_F(AnimalPartsTest, ASpikeLeavesNoHoleInTheMask) {
  // Amid what both have.
  const Eigen::VectorXd along = a_.rest.col(0);
  const double middle = 0.42 * along.minCoeff() + 0.58 * along.maxCoeff();
  VertexIndex center = 0;
  for (std::size_t v = 0; v < x_.origin.size(); ++v) {
    if (std::abs(along[x_.origin[v]] - middle) <
        std::abs(along[x_.origin[center]] - middle)) {
      center = static_cast<VertexIndex>(v);
    }
  }
  TriangleMesh x = x_.mesh;
  const double radius = 0.12 * std::sqrt(SurfaceArea(x));
  const Eigen::RowVector3d outward = VertexNormals(x).row(center);
  std::vector<VertexIndex> on_spike;
  for (VertexIndex v = 0; v < x.num_vertices(); ++v) {
    const double distance =
        (x_.mesh.positions.row(v) - x_.mesh.positions.row(center)).norm();
    if (distance >= radius) continue;
    x.positions.row(v) += 3 * (radius - distance) * outward;
    on_spike.push_back(v);
  }
  MatchOptions options;
  options.relation = Relation::kOverlap;
  options.scale = LengthScale::kSame;
  const auto found = Match(x, y_.mesh, {}, options);
  ASSERT_THAT(found, IsOk());
  for (const VertexIndex v : on_spike) {
    EXPECT_NE(found->y_from_x[v], kNoVertex) << v;
  }
  // What fills the hole is less sure, and not in the mean.
  EXPECT_LT(MeanConfidence(found->confidence, found->y_from_x),
            found->quality.mean_confidence - 1e-4);
}

TEST_F(AnimalPartsTest, APartIsFoundOnTheWholeInAnotherUnit) {
  MatchOptions options;
  options.relation = Relation::kPartOfX;
  const TriangleMesh y = {25.4 * y_.mesh.positions, y_.mesh.faces};
  const auto found = Match(a_.mesh, y, {}, options);
  ASSERT_THAT(found, IsOk());
  EXPECT_LT(ErrorOf(found->y_from_x, y_from_whole_), 0.03);
  EXPECT_GT(IouOf(a_.mesh, found->y_from_x, y_from_whole_), 0.9);
  EXPECT_NEAR(found->scale, 25.4, 1);
}

TEST_F(AnimalPartsTest, WhatIsSeenFromOneSideIsFoundOnTheWhole) {
  const Eigen::RowVector3d side(0.2, -1, 0.4);
  const Positions normals = VertexNormals(a_.mesh);
  const DirtyMesh seen = WithoutLoneVertices(WithoutFaces(
      Untouched(a_.mesh), [&](const TriangleMesh& mesh, VertexIndex f) {
        return normals.row(mesh.faces(f, 0)).dot(side) < 0;
      }));
  ASSERT_LT(SurfaceArea(seen.mesh), 0.6 * SurfaceArea(a_.mesh));
  const VertexMap b_from_a = SampleTruth(a_, b_);
  VertexMap truth;
  for (const VertexIndex v : seen.origin) truth.push_back(b_from_a[v]);
  MatchOptions options;
  options.relation = Relation::kPartOfY;
  options.scale = LengthScale::kSame;
  const auto found = Match(seen.mesh, b_.mesh, {}, options);
  ASSERT_THAT(found, IsOk());
  EXPECT_LT(GeodesicErrorMeter(b_.mesh)
                .Measure(found->y_from_x, truth)
                ->mean_over_diameter,
            0.025);
}

TEST_F(AnimalPartsTest, WhatThePartsAreIsFoundOut) {
  MatchOptions options;
  options.relation = Relation::kAuto;
  options.scale = LengthScale::kSame;
  const auto overlap = Match(x_.mesh, y_.mesh, {}, options);
  ASSERT_THAT(overlap, IsOk());
  EXPECT_EQ(overlap->relation, Relation::kOverlap);
  EXPECT_LT(ErrorOf(overlap->y_from_x, truth_), 0.02);
  options.scale = LengthScale::kAuto;
  const auto part = Match(a_.mesh, y_.mesh, {}, options);
  ASSERT_THAT(part, IsOk());
  EXPECT_EQ(part->relation, Relation::kPartOfX);
  EXPECT_LT(ErrorOf(part->y_from_x, y_from_whole_), 0.03);
  const auto wholes = Match(a_.mesh, b_.mesh, {}, options);
  ASSERT_THAT(wholes, IsOk());
  EXPECT_EQ(wholes->relation, Relation::kWhole);
}

TEST_F(AnimalPartsTest, LandmarksInAnOverlapAreKept) {
  std::vector<Landmark> landmarks;
  for (VertexIndex x = 0; landmarks.size() < 3; x += 97) {
    if (truth_[x] != kNoVertex) landmarks.push_back({x, truth_[x]});
  }
  MatchOptions options;
  options.relation = Relation::kOverlap;
  options.scale = LengthScale::kSame;
  for (const bool exact : {false, true}) {
    options.landmarks_exact = exact;
    const auto found = Match(x_.mesh, y_.mesh, landmarks, options);
    ASSERT_THAT(found, IsOk());
    EXPECT_LT(ErrorOf(found->y_from_x, truth_), 0.03);
    for (const Landmark& landmark : landmarks) {
      EXPECT_EQ(found->y_from_x[landmark.x], landmark.y);
    }
  }
}

}  // namespace
}  // namespace isomatch
