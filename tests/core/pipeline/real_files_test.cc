// Meshes as they come out of files. Each test damages FiveArms in one way, has
// it matched with a good, relabeled and moved copy, both ways round, and
// measures the error on the good mesh.

#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/evaluation/geodesic_error.h"
#include "core/mesh/topology.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/matcher.h"
#include "tests/support/dirty_meshes.h"
#include "tests/support/matchers.h"
#include "tests/support/quick_options.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;

using Warnings = std::vector<std::string>;

/// One result, its map expressed in vertices of the good mesh.
struct Measured {
  Correspondence found;
  GeodesicError error;
};

absl::StatusOr<Measured> MatchAndMeasure(const GeodesicErrorMeter& meter,
                                         const DirtyMesh& x,
                                         const DirtyMesh& y) {
  absl::StatusOr<Correspondence> found =
      Match(x.mesh, y.mesh, {}, QuickOptions());
  if (!found.ok()) return found.status();
  VertexMap on_good_mesh;
  for (std::size_t v = 0; v < x.origin.size(); ++v) {
    const VertexIndex image = found->y_from_x[v];
    on_good_mesh.push_back(image == kNoVertex ? kNoVertex : y.origin[image]);
    // Only a vertex on no face has no image.
    EXPECT_EQ(image == kNoVertex, x.origin[v] == kNoVertex) << v;
    EXPECT_TRUE(std::isfinite(found->confidence[v])) << v;
  }
  absl::StatusOr<GeodesicError> error = meter.Measure(on_good_mesh, x.origin);
  if (!error.ok()) return error.status();
  return Measured{*std::move(found), *error};
}

/// `mesh` with its vertices renamed and its place changed.
DirtyMesh Disguised(const DirtyMesh& dirty, double scale) {
  const VertexIndex n = dirty.mesh.num_vertices();
  const auto permutation = RandomPermutation(n, /*seed=*/5);
  DirtyMesh result{Moved(Relabeled(dirty.mesh, permutation), scale),
                   VertexMap(n)};
  for (VertexIndex v = 0; v < n; ++v) {
    result.origin[permutation[v]] = dirty.origin[v];
  }
  return result;
}

/// Expects the damaged mesh to be matched with the good one, as X, as Y and as
/// both, with a mean error of at most `tolerance` diameters and with warnings
/// that match.
void ExpectMatched(const TriangleMesh& good, const DirtyMesh& dirty,
                   double tolerance,
                   const testing::Matcher<const Warnings&>& warnings) {
  const GeodesicErrorMeter meter(good);
  const DirtyMesh other = Disguised(Untouched(good), 37);
  const DirtyMesh dirty_other = Disguised(dirty, 37);
  const auto check = [&](const char* what, const DirtyMesh& x,
                         const DirtyMesh& y, bool x_dirty, bool y_dirty) {
    SCOPED_TRACE(what);
    const absl::StatusOr<Measured> result = MatchAndMeasure(meter, x, y);
    ASSERT_THAT(result, IsOk());
    EXPECT_EQ(result->error.unmatched, 0);
    EXPECT_LT(result->error.mean_over_diameter, tolerance);
    if (x_dirty) {
      EXPECT_THAT(result->found.warnings_x, warnings);
    } else {
      EXPECT_THAT(result->found.warnings_x, IsEmpty());
    }
    if (y_dirty) {
      EXPECT_THAT(result->found.warnings_y, warnings);
    } else {
      EXPECT_THAT(result->found.warnings_y, IsEmpty());
    }
  };
  check("X damaged", dirty, other, true, false);
  check("Y damaged", Untouched(good), dirty_other, false, true);
  check("both damaged", dirty, dirty_other, true, true);
}

TEST(RealFilesTest, HolesAndACutCap) {
  const TriangleMesh good = FiveArms(3);
  const DirtyMesh holes =
      WithoutFaces(WithoutFaces(Untouched(good), AtRandom(0.04, /*seed=*/1)),
                   Beyond({0.1, -0.2, -1}, 0.8));
  ASSERT_GT(EdgeFaces(holes.mesh.faces).boundary_edges(), 100);
  ExpectMatched(good, holes, 0.03, Contains(HasSubstr("boundary edges")));
}

TEST(RealFilesTest, NonManifoldEdges) {
  const TriangleMesh good = FiveArms(3);
  const DirtyMesh fins = WithFins(Untouched(good), AtRandom(0.01, /*seed=*/2));
  const int count = EdgeFaces(fins.mesh.faces).nonmanifold_edges();
  ASSERT_GT(count, 5);
  ExpectMatched(
      good, fins, 0.02,
      Contains(HasSubstr(std::to_string(count) + " non-manifold edges")));
}

TEST(RealFilesTest, PatchesThatTouchInOneVertex) {
  const TriangleMesh good = FiveArms(3);
  const DirtyMesh touching =
      WithTouchingTetrahedra(Untouched(good), AtRandom(0.005, /*seed=*/3), 0.1);
  ASSERT_GT(touching.mesh.num_vertices(), good.num_vertices() + 9);
  ASSERT_EQ(ConnectedComponents(touching.mesh).count, 1);
  ExpectMatched(good, touching, 0.02, testing::_);
}

TEST(RealFilesTest, ATriangleSoup) {
  const TriangleMesh good = FiveArms(3);
  ExpectMatched(good, TriangleSoup(Untouched(good)), 0.01,
                Contains(HasSubstr("coincide with others and were joined")));
}

TEST(RealFilesTest, RepeatedFaces) {
  const TriangleMesh good = FiveArms(3);
  const DirtyMesh repeated =
      WithRepeatedFaces(Untouched(good), AtRandom(0.1, /*seed=*/4));
  const int count = repeated.mesh.num_faces() - good.num_faces();
  ASSERT_GT(count, 50);
  ExpectMatched(good, repeated, 0.01,
                Contains(HasSubstr(std::to_string(count) +
                                   " degenerate or repeated faces")));
}

TEST(RealFilesTest, FacesThatNameAVertexTwice) {
  const TriangleMesh good = FiveArms(3);
  const DirtyMesh repeated =
      WithRepeatedCorners(Untouched(good), AtRandom(0.02, /*seed=*/5));
  const int count = repeated.mesh.num_faces() - good.num_faces();
  ASSERT_GT(count, 10);
  ExpectMatched(good, repeated, 0.01,
                Contains(HasSubstr(std::to_string(count) +
                                   " degenerate or repeated faces")));
}

TEST(RealFilesTest, FacesWithoutAreaAlongALine) {
  const TriangleMesh good = FiveArms(3);
  ExpectMatched(good, WithFlatFaces(Untouched(good), AtRandom(0.03, 6)), 0.01,
                testing::_);
}

TEST(RealFilesTest, EdgesWithoutLength) {
  const TriangleMesh good = FiveArms(3);
  ExpectMatched(good, WithCollapsedEdges(Untouched(good), AtRandom(0.02, 7)),
                0.02, testing::_);
}

TEST(RealFilesTest, Slivers) {
  const TriangleMesh good = FiveArms(3);
  for (const double offset : {1e-3, 1e-7, 1e-12}) {
    SCOPED_TRACE(offset);
    ExpectMatched(good, WithSlivers(Untouched(good), AtRandom(0.05, 8), offset),
                  0.01, testing::_);
  }
}

TEST(RealFilesTest, VerticesOnNoFace) {
  const TriangleMesh good = FiveArms(3);
  ExpectMatched(good, WithLoneVertices(Untouched(good), 7), 0.01,
                Contains(HasSubstr("7 vertices are on no face")));
}

TEST(RealFilesTest, FacesTurnedAtRandom) {
  const TriangleMesh good = FiveArms(3);
  ExpectMatched(good, WithFlippedFaces(Untouched(good), AtRandom(0.5, 9)), 0.01,
                Contains(HasSubstr("faces turned to point outwards")));
}

TEST(RealFilesTest, AMeshInsideOut) {
  const TriangleMesh good = FiveArms(3);
  ExpectMatched(good, WithFlippedFaces(Untouched(good), AtRandom(1, 9)), 0.01,
                Contains(HasSubstr(std::to_string(good.num_faces()) +
                                   " faces turned to point outwards")));
}

TEST(RealFilesTest, OneArmManyTimesFinerThanTheRest) {
  const TriangleMesh good = FiveArms(3);
  DirtyMesh uneven = Untouched(good);
  for (int i = 0; i < 3; ++i) {
    uneven = Refined(uneven, Beyond(kFourthArm, 1.2));
  }
  ASSERT_EQ(EdgeFaces(uneven.mesh.faces).boundary_edges(), 0);
  ASSERT_GT(uneven.mesh.num_vertices(), 3 * good.num_vertices());
  // A vertex in the middle of an edge counts as one of its ends.
  ExpectMatched(good, uneven, 0.04, IsEmpty());
}

TEST(RealFilesTest, AVeryCoarseAndAVeryFineMesh) {
  const TriangleMesh coarse = FiveArms(2);
  const TriangleMesh fine = FiveArms(5);
  ASSERT_GT(fine.num_vertices(), 50 * coarse.num_vertices());
  // Subdivision keeps the coarse vertices first.
  VertexMap truth(fine.num_vertices(), kNoVertex);
  for (VertexIndex v = 0; v < coarse.num_vertices(); ++v) truth[v] = v;
  const auto down = Match(fine, Moved(coarse, 0.1), {}, QuickOptions());
  ASSERT_THAT(down, IsOk());
  const auto error_down =
      GeodesicErrorMeter(coarse).Measure(down->y_from_x, truth);
  ASSERT_THAT(error_down, IsOk());
  EXPECT_LT(error_down->mean_over_diameter, 0.05);
  truth.resize(coarse.num_vertices());
  const auto up = Match(Moved(coarse, 0.1), fine, {}, QuickOptions());
  ASSERT_THAT(up, IsOk());
  const auto error_up = GeodesicErrorMeter(fine).Measure(up->y_from_x, truth);
  ASSERT_THAT(error_up, IsOk());
  EXPECT_LT(error_up->mean_over_diameter, 0.05);
}

TEST(RealFilesTest, TinyHugeAndFarAwayCoordinates) {
  const TriangleMesh good = FiveArms(3);
  for (const double scale : {1e-6, 1e6}) {
    SCOPED_TRACE(scale);
    DirtyMesh scaled = Untouched(good);
    scaled.mesh.positions *= scale;
    ExpectMatched(good, scaled, 0.01, IsEmpty());
    scaled.mesh = Shifted(scaled.mesh, 1e5);
    ExpectMatched(good, scaled, 0.01, IsEmpty());
  }
}

TEST(RealFilesTest, DamageOfEveryKindAtOnce) {
  const TriangleMesh good = FiveArms(3);
  DirtyMesh dirty = WithoutFaces(Untouched(good), AtRandom(0.02, 11));
  dirty = WithFins(dirty, AtRandom(0.005, 12));
  dirty = WithSlivers(dirty, AtRandom(0.02, 13), 1e-5);
  dirty = WithCollapsedEdges(dirty, AtRandom(0.005, 14));
  dirty = WithRepeatedCorners(dirty, AtRandom(0.02, 15));
  dirty = WithRepeatedFaces(dirty, AtRandom(0.02, 16));
  dirty = WithFlippedFaces(dirty, AtRandom(0.3, 17));
  dirty = WithLoneVertices(dirty, 5);
  dirty.mesh = Shifted(dirty.mesh, 1e3);
  ExpectMatched(good, dirty, 0.03,
                AllOf(Contains(HasSubstr("on no face")),
                      Contains(HasSubstr("non-manifold edges")),
                      Contains(HasSubstr("boundary edges")),
                      Contains(HasSubstr("degenerate or repeated faces")),
                      Contains(HasSubstr("turned to point outwards"))));
}

TEST(RealFilesTest, CrumbsAroundABodyGoWhereTheyAreNear) {
  const TriangleMesh good = FiveArms(3);
  DirtyMesh all = Untouched(good);
  for (const VertexIndex v : {3, 40, 200, 350, 600}) {
    DirtyMesh crumb = Untouched(Tetrahedron());
    crumb.mesh.positions *= 0.05;
    crumb.mesh.positions.rowwise() += good.positions.row(v);
    crumb.origin.assign(4, v);
    all = Joined(all, crumb, 0);
  }
  ASSERT_EQ(ConnectedComponents(all.mesh).count, 6);
  ExpectMatched(
      good, all, 0.01,
      AllOf(Contains(HasSubstr("6 separate components")),
            Contains(HasSubstr("20 vertices of small components follow"))));
  const DirtyMesh other = Disguised(Untouched(good), 37);
  const auto found = Match(all.mesh, other.mesh, {}, QuickOptions());
  ASSERT_THAT(found, IsOk());
  for (std::size_t v = good.num_vertices(); v < all.origin.size(); ++v) {
    const VertexIndex image = other.origin[found->y_from_x[v]];
    EXPECT_LT(
        (good.positions.row(image) - good.positions.row(all.origin[v])).norm(),
        0.25)
        << v;
  }
}

TEST(RealFilesTest, TwoLargeComponentsAndCrumbsAroundThem) {
  const TriangleMesh arms = FiveArms(3);
  TriangleMesh blob = FiveArms(3);  // another hand
  blob.positions.col(0) *= 1.6;
  blob.positions.rowwise() += Eigen::RowVector3d(0, 0, 9);
  const VertexIndex in_large = arms.num_vertices() + blob.num_vertices();
  DirtyMesh all = Joined(Untouched(arms), Untouched(blob), arms.num_vertices());
  const VertexIndex near[] = {3, 40, 200, arms.num_vertices() + 10,
                              arms.num_vertices() + 100};
  for (const VertexIndex v : near) {
    DirtyMesh crumb = Untouched(Tetrahedron());
    crumb.mesh.positions *= 0.05;
    crumb.mesh.positions.rowwise() += all.mesh.positions.row(v);
    crumb.origin.assign(4, v);
    all = Joined(all, crumb, 0);
  }
  ASSERT_EQ(ConnectedComponents(all.mesh).count, 7);
  const DirtyMesh other = Disguised(all, 37);
  const auto result = Match(all.mesh, other.mesh, {}, QuickOptions());
  ASSERT_THAT(result, IsOk());
  const TriangleMesh* const parts[] = {&arms, &blob};
  for (const int part : {0, 1}) {
    const VertexIndex first = part * arms.num_vertices();
    const GeodesicErrorMeter meter(*parts[part]);
    VertexMap found, truth, crumbs, crumbs_truth;
    for (std::size_t v = 0; v < all.origin.size(); ++v) {
      const VertexIndex true_vertex = all.origin[v] - first;
      if (true_vertex < 0 || true_vertex >= parts[part]->num_vertices()) {
        continue;
      }
      const VertexIndex image = result->y_from_x[v];
      ASSERT_NE(image, kNoVertex) << v;
      const VertexIndex local = other.origin[image] - first;
      const bool same = local >= 0 && local < parts[part]->num_vertices();
      const bool is_crumb = static_cast<VertexIndex>(v) >= in_large;
      (is_crumb ? crumbs : found).push_back(same ? local : kNoVertex);
      (is_crumb ? crumbs_truth : truth).push_back(true_vertex);
    }
    const auto error = meter.Measure(found, truth);
    ASSERT_THAT(error, IsOk());
    const auto crumb_error = meter.Measure(crumbs, crumbs_truth);
    ASSERT_THAT(crumb_error, IsOk());
    EXPECT_EQ(error->unmatched, 0);  // none in the other component
    EXPECT_LT(error->mean_over_diameter, 0.02);
    EXPECT_EQ(crumb_error->unmatched, 0);
    EXPECT_LT(crumb_error->max_over_diameter, 0.06);
  }
  for (const Warnings& warnings : {result->warnings_x, result->warnings_y}) {
    EXPECT_THAT(warnings, Contains(HasSubstr("7 separate components")));
    EXPECT_THAT(warnings,
                Contains(HasSubstr("20 vertices of small components follow")));
  }
}

}  // namespace
}  // namespace isomatch
