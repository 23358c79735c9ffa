#include "client/files/landmark_points.h"

#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

bool IsPair(const VertexMatch& match, VertexIndex x, VertexIndex y) {
  return match.x == x && match.y == y;
}

class LandmarkPointsTest : public testing::Test {
 protected:
  absl::StatusOr<SnappedPoints> Snap(const std::string& name,
                                     const std::string& text) {
    return ReadSnappedPoints(folder_.Write(name, text), mesh_, "X");
  }
  static SnappedPoint At(const std::string& label, VertexIndex vertex) {
    SnappedPoint point;
    point.label = label;
    point.vertex = vertex;
    return point;
  }
  TemporaryFolder folder_;
  // Off the middle, so that turning it is no symmetry.
  const TriangleMesh mesh_ = [] {
    TriangleMesh mesh = BumpySphere(3);
    mesh.positions.col(0).array() += 3;
    return mesh;
  }();
};

TEST_F(LandmarkPointsTest, PointsGoToTheNearestPlace) {
  // Above the middles of faces, told by brute force over all faces.
  std::string text;
  std::vector<Eigen::RowVector3d> points;
  std::vector<VertexIndex> all(static_cast<std::size_t>(mesh_.num_faces()));
  for (std::size_t f = 0; f < all.size(); ++f) {
    all[f] = static_cast<VertexIndex>(f);
  }
  for (VertexIndex f = 0; f < mesh_.num_faces(); f += 7) {
    points.emplace_back(1.02 * PositionOf(mesh_, {f, {0.5, 0.3, 0.2}}));
    absl::StrAppend(&text, points.back().x(), " ", points.back().y(), " ",
                    points.back().z(), "\n");
  }
  const auto snapped = Snap("p.txt", text);
  ASSERT_THAT(snapped, IsOk());
  ASSERT_EQ(snapped->points.size(), points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const SnappedPoint& found = snapped->points[i];
    const double least =
        (PositionOf(mesh_, NearestOnFaces(mesh_, all, points[i])) - points[i])
            .norm();
    EXPECT_NEAR(found.distance, least, 1e-4);  // six digits in the text
    for (int k = 0; k < 3; ++k) {
      const VertexIndex v = mesh_.faces(found.place.face, k);
      EXPECT_GE((mesh_.positions.row(v) - points[i]).norm(),
                found.vertex_distance - 1e-4);
    }
  }
  EXPECT_THAT(snapped->summary,
              HasSubstr(absl::StrCat("landmarks on X: ", points.size())));
}

TEST_F(LandmarkPointsTest, TheNearestPlaceNeedNotBeAtTheNearestVertex) {
  // A point over the middle of a large face, beside a small one.
  TriangleMesh mesh = {Positions(6, 3), Faces(2, 3)};
  mesh.positions << -10, -10, 0, 10, -10, 0, 0, 20, 0,  //
      0.8, 0, 0.5, 0.9, 0, 0.5, 0.8, 0.1, 0.5;
  mesh.faces << 0, 1, 2, 3, 4, 5;
  const auto snapped =
      ReadSnappedPoints(folder_.Write("p.txt", "0.5 -1 0.25\n"), mesh, "X");
  ASSERT_THAT(snapped, IsOk());
  EXPECT_EQ(snapped->points[0].place.face, 0);
  EXPECT_NEAR(snapped->points[0].distance, 0.25, 1e-12);
  EXPECT_EQ(snapped->points[0].vertex, 1);
}

TEST_F(LandmarkPointsTest, FarPointsAreNamedAndAbsurdOnesRefused) {
  const Eigen::RowVector3d at = mesh_.positions.row(0);
  const auto line = [&](double away, const std::string& label) {
    const Eigen::RowVector3d from_middle = at - Eigen::RowVector3d(3, 0, 0);
    const Eigen::RowVector3d point = at + away * from_middle.normalized();
    return absl::StrCat(point.x(), " ", point.y(), " ", point.z(), " ", label,
                        "\n");
  };
  const auto far = Snap("p.txt", line(0, "near") + line(0.2, "off"));
  ASSERT_THAT(far, IsOk());
  EXPECT_THAT(far->warnings,
              ElementsAre(HasSubstr("1 points are farther from the surface "
                                    "than 1 % of the diagonal")));
  EXPECT_THAT(far->warnings[0], HasSubstr(": 'off' 0.1825"));
  EXPECT_THAT(far->summary, HasSubstr("'off' the farthest with 0.1825"));
  EXPECT_THAT(Snap("p.txt", line(0, "near") + line(30, "off")),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("'off' is 29.89 from the surface")));
  EXPECT_THAT(Snap("p.txt", line(30, "off")).status().message(),
              HasSubstr("in another coordinate system or unit"));
}

TEST_F(LandmarkPointsTest, TheOtherSystemIsTakenOnlyWhereItFits) {
  std::vector<LandmarkPoint> points;
  for (const VertexIndex v : {0, 10, 20}) {
    points.push_back({mesh_.positions.row(v), ""});
  }
  const auto as_is = Snap("a.fcsv", FormatPoints("a.fcsv", "RAS", points));
  ASSERT_THAT(as_is, IsOk());
  EXPECT_THAT(as_is->warnings, IsEmpty());
  EXPECT_EQ(as_is->space, "RAS");
  for (LandmarkPoint& point : points) point.position.head<2>() *= -1;
  for (const char* const space : {"RAS", "LPS"}) {
    const auto turned = Snap("b.fcsv", FormatPoints("b.fcsv", space, points));
    ASSERT_THAT(turned, IsOk());
    EXPECT_EQ(turned->points[1].vertex, 10);
    EXPECT_NE(turned->space, space);
    EXPECT_THAT(turned->warnings,
                ElementsAre(HasSubstr("x and y are negated")));
  }
  // A file that says nothing is taken as it is.
  EXPECT_THAT(Snap("c.csv", FormatPoints("c.csv", "", points)),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("another coordinate system")));
}

TEST_F(LandmarkPointsTest, PointsPairByLabelElseByOrder) {
  std::vector<std::string> warnings;
  const auto labeled =
      PairPoints({{At("a", 1), At("b", 2), At("c", 3)}},
                 {{At("c", 30), At("a", 10), At("d", 40)}}, "F", &warnings);
  ASSERT_THAT(labeled, IsOk());
  ASSERT_EQ(labeled->size(), 2u);
  EXPECT_TRUE(IsPair((*labeled)[0], 1, 10) && IsPair((*labeled)[1], 3, 30));
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("left out: b; d")));
  warnings.clear();
  // Labels of one file alone, or there twice, say nothing.
  const auto ordered = PairPoints({{At("a", 1), At("a", 2)}},
                                  {{At("a", 10), At("", 20)}}, "F", &warnings);
  ASSERT_THAT(ordered, IsOk());
  EXPECT_TRUE(IsPair((*ordered)[0], 1, 10) && IsPair((*ordered)[1], 2, 20));
  EXPECT_THAT(warnings, IsEmpty());
  ASSERT_THAT(PairPoints({{At("F-1", 1)}}, {{At("P-1", 5)}}, "F", &warnings),
              IsOk());
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("paired by order")));
}

TEST_F(LandmarkPointsTest, PairsThatContradictAreRefused) {
  std::vector<std::string> warnings;
  EXPECT_THAT(
      PairPoints({{At("", 1), At("", 2)}}, {{At("", 5)}}, "F", &warnings),
      StatusIs(absl::StatusCode::kInvalidArgument,
               HasSubstr("2 points of X and 1 of Y")));
  EXPECT_THAT(PairPoints({{At("a", 1), At("b", 1)}}, {{At("a", 5), At("b", 6)}},
                         "F", &warnings),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("'a' and 'b' of X are both nearest to vertex "
                                 "1")));
  EXPECT_THAT(PairPoints({{At("a", 1), At("b", 2)}}, {{At("a", 5), At("b", 5)}},
                         "F", &warnings),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("'a' and 'b' of Y")));
  EXPECT_THAT(PairPoints({{At("a", 1), At("b", 1)}}, {{At("a", 5), At("b", 5)}},
                         "F", &warnings),
              IsOk());
}

}  // namespace
}  // namespace isomatch
