#include "core/pipeline/matcher.h"
#include "core/mesh/precise_point.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/progress.h"

#include <algorithm>
#include <cstdlib>
#include <iterator>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "core/evaluation/geodesic_error.h"
#include "tests/core/pipeline/two_poses.h"
#include "tests/support/matchers.h"
#include "tests/support/quick_options.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;

constexpr auto kInvalid = absl::StatusCode::kInvalidArgument;
constexpr Profile kProfiles[] = {Profile::kDefault, Profile::kPaper};

/// QuickOptions for either profile.
MatchOptions QuickOptionsOf(Profile profile) {
  if (profile == Profile::kDefault) return QuickOptions();
  MatchOptions options = MatchOptions::ForProfile(profile);
  options.first_stage_matches = 80;
  options.seed_points = 5;
  // The five arms differ enough for Eq. 8 to be a fair judge of few seeds.
  options.max_seeds = 24;
  options.selection = Selection::kEmbeddingError;
  options.zoomout_end = 60;
  return options;
}

TEST(MatcherTest, UndoesARelabeling) {
  const TriangleMesh mesh = FiveArms(3);
  const auto permutation = RandomPermutation(mesh.num_vertices(), /*seed=*/1);
  for (const Profile profile : kProfiles) {
    const auto found = Match(mesh, Moved(Relabeled(mesh, permutation), 37), {},
                             QuickOptionsOf(profile));
    ASSERT_THAT(found, IsOk());
    EXPECT_GT(FractionRight(found->y_from_x, permutation), 0.99)
        << ProfileName(profile);
    EXPECT_LT(found->scores.embedding_error, 0.01);
    EXPECT_GT(found->scores.orientation_score, 0.9);
    EXPECT_NEAR(found->area_y / found->area_x, 37 * 37, 1);
  }
}

TEST(MatcherTest, MatchesDifferentResolutionsBothWays) {
  const TriangleMesh fine = FiveArms(4);
  const TriangleMesh coarse = FiveArms(3);
  // Subdivision keeps the coarse vertices first.
  VertexMap truth(fine.num_vertices(), kNoVertex);
  for (VertexIndex v = 0; v < coarse.num_vertices(); ++v) truth[v] = v;
  for (const Profile profile : kProfiles) {
    const auto down = Match(fine, coarse, {}, QuickOptionsOf(profile));
    ASSERT_THAT(down, IsOk());
    const auto error =
        GeodesicErrorMeter(coarse).Measure(down->y_from_x, truth);
    ASSERT_THAT(error, IsOk());
    EXPECT_LT(error->mean_over_diameter, 0.03) << ProfileName(profile);
    const auto up = Match(coarse, fine, {}, QuickOptionsOf(profile));
    ASSERT_THAT(up, IsOk());
    truth.resize(coarse.num_vertices());
    const auto error_up = GeodesicErrorMeter(fine).Measure(up->y_from_x, truth);
    ASSERT_THAT(error_up, IsOk());
    EXPECT_LT(error_up->mean_over_diameter, 0.03) << ProfileName(profile);
    truth.resize(fine.num_vertices(), kNoVertex);
  }
}

TEST(MatcherTest, MeshesSmallerThanAnyConstantWork) {
  const TriangleMesh shapes[] = {Tetrahedron(), PlaneGrid(1, 1, 1, 2),
                                 UnitSphere(0), PlaneGrid(2, 2, 1, 2)};
  for (const Profile profile : kProfiles) {
    for (const TriangleMesh& x : shapes) {
      for (const TriangleMesh& y : shapes) {
        const auto found = Match(x, y, {}, MatchOptions::ForProfile(profile));
        ASSERT_THAT(found, IsOk());
        ASSERT_EQ(found->y_from_x.size(), std::size_t(x.num_vertices()));
        for (const VertexIndex v : found->y_from_x) {
          EXPECT_GE(v, 0);
          EXPECT_LT(v, y.num_vertices());
        }
      }
    }
    const auto self = Match(Tetrahedron(), Tetrahedron(), {},
                            MatchOptions::ForProfile(profile));
    ASSERT_THAT(self, IsOk());
    EXPECT_EQ(self->y_from_x, (VertexMap{0, 1, 2, 3})) << ProfileName(profile);
  }
}

TEST(MatcherTest, OneTriangleWorks) {
  TriangleMesh triangle;
  triangle.positions.resize(3, 3);
  triangle.positions << 0, 0, 0, 3, 0, 0, 0, 1, 0;
  triangle.faces.resize(1, 3);
  triangle.faces << 0, 1, 2;
  for (const Profile profile : kProfiles) {
    const auto found =
        Match(triangle, triangle, {}, MatchOptions::ForProfile(profile));
    ASSERT_THAT(found, IsOk());
    EXPECT_EQ(found->y_from_x, (VertexMap{0, 1, 2}));
  }
}

TEST(MatcherTest, SameBytesAtAnyThreadCountAndOtherOnesForAnotherSeed) {
  // More workers than this machine may have cores.
  const tbb::global_control many(tbb::global_control::max_allowed_parallelism,
                                 8);
  const TriangleMesh x = FiveArms(3);
  const TriangleMesh y = BumpySphere(3);
  for (const Profile profile : kProfiles) {
    MatchOptions options = QuickOptionsOf(profile);
    options.temperature = 0.5;
    std::vector<VertexMap> maps;
    for (const int threads : {1, 2, 4, 8}) {
      options.threads = threads;
      const auto found = Match(x, y, {}, options);
      ASSERT_THAT(found, IsOk());
      maps.push_back(found->y_from_x);
    }
    EXPECT_THAT(maps, testing::Each(maps[0])) << ProfileName(profile);
    options.random_seed = 99;
    const auto other = Match(x, y, {}, options);
    ASSERT_THAT(other, IsOk());
    EXPECT_NE(maps[0], other->y_from_x) << ProfileName(profile);
  }
}

TEST(MatcherTest, DoesNotDependOnTheUnit) {
  const TriangleMesh x = FiveArms(3);
  const auto permutation = RandomPermutation(x.num_vertices(), /*seed=*/1);
  for (const double scale : {1e-6, 1e6}) {
    const auto found =
        Match(Moved(x, scale), Relabeled(x, permutation), {}, QuickOptions());
    ASSERT_THAT(found, IsOk());
    EXPECT_GT(FractionRight(found->y_from_x, permutation), 0.99);
  }
}

TEST(MatcherTest, LandmarksTakeThePlaceOfSeeds) {
  const TriangleMesh mesh = FiveArms(3);
  const auto permutation = RandomPermutation(mesh.num_vertices(), /*seed=*/2);
  const TriangleMesh other = Moved(Relabeled(mesh, permutation), 3);
  for (const std::size_t count : {1, 2, 6, 100, 400}) {
    std::vector<Landmark> landmarks;
    for (std::size_t i = 0; i < count; ++i) {
      const auto x = static_cast<VertexIndex>(i * 642 / count);
      landmarks.push_back({x, permutation[x]});
    }
    const auto found = Match(mesh, other, landmarks, QuickOptions());
    ASSERT_THAT(found, IsOk());
    EXPECT_GT(FractionRight(found->y_from_x, permutation), 0.95) << count;
    EXPECT_GE(found->sparse_matches.size(), count);
  }
}

TEST(MatcherTest, PrecisePointsOfLandmarksAreTheirs) {
  const TriangleMesh mesh = FiveArms(3);
  const auto permutation = RandomPermutation(mesh.num_vertices(), /*seed=*/2);
  MatchOptions options = QuickOptions();
  // So few that all have run when the choice is made.
  options.alignment_rounds = 3;
  options.landmarks_exact = true;
  const std::vector<Landmark> landmarks = {
      {10, permutation[11]}, {200, permutation[200]}, {400, permutation[400]}};
  const auto found =
      Match(mesh, Moved(Relabeled(mesh, permutation), 3), landmarks, options);
  ASSERT_THAT(found, IsOk());
  for (const Landmark& landmark : landmarks) {
    EXPECT_EQ(found->y_from_x[landmark.x], landmark.y);
    const PrecisePoint& point = found->precise[landmark.x];
    double there = 0;
    for (int corner = 0; corner < 3; ++corner) {
      if (point.vertices[corner] == landmark.y) there += point.weights[corner];
    }
    EXPECT_NEAR(there, 1, 1e-6);
  }
}

TEST(MatcherTest, LandmarksChooseTheSideOfASymmetricShape) {
  // A rectangle has the half turn besides the identity.
  const TriangleMesh plane = PlaneGrid(20, 10, 2, 1);
  const VertexIndex last = plane.num_vertices() - 1;
  VertexMap half_turn(plane.num_vertices());
  for (VertexIndex v = 0; v <= last; ++v) half_turn[v] = last - v;
  const std::vector<Landmark> turned = {
      {0, last}, {20, last - 20}, {30, last - 30}, {90, last - 90}};
  const auto found = Match(plane, plane, turned, QuickOptions());
  ASSERT_THAT(found, IsOk());
  EXPECT_GT(FractionRight(found->y_from_x, half_turn), 0.9);
}

TEST(MatcherTest, RefusesLandmarksThatAreWrong) {
  const TriangleMesh mesh = FiveArms(2);
  const auto match = [&](std::vector<Landmark> landmarks) {
    return Match(mesh, mesh, landmarks, QuickOptions()).status();
  };
  EXPECT_THAT(match({{0, 0}, {162, 1}}),
              StatusIs(kInvalid, HasSubstr("landmarks[1].x: 162")));
  EXPECT_THAT(match({{0, -1}}),
              StatusIs(kInvalid, HasSubstr("landmarks[0].y: -1")));
  EXPECT_THAT(match({{3, 4}, {3, 5}}),
              StatusIs(kInvalid, AllOf(HasSubstr("landmarks[1].x: vertex 3"),
                                       HasSubstr("landmarks[0]"))));
  EXPECT_THAT(match({{3, 4}, {5, 4}}),
              StatusIs(kInvalid, HasSubstr("landmarks[1].y")));
}

/// `mesh` with one more vertex, on no face, before the others.
TriangleMesh WithLoneVertex(const TriangleMesh& mesh) {
  TriangleMesh result;
  result.positions.resize(mesh.num_vertices() + 1, 3);
  result.positions << Eigen::RowVector3d(50, 50, 50), mesh.positions;
  result.faces = (mesh.faces.array() + 1).matrix();
  return result;
}

TEST(MatcherTest, AVertexOnNoFaceStaysUnmatchedAndIsNoTarget) {
  const TriangleMesh mesh = WithLoneVertex(FiveArms(2));
  const auto found = Match(mesh, mesh, {}, QuickOptions());
  ASSERT_THAT(found, IsOk());
  EXPECT_EQ(found->y_from_x[0], kNoVertex);
  for (std::size_t v = 1; v < found->y_from_x.size(); ++v) {
    EXPECT_GT(found->y_from_x[v], 0);
  }
  std::vector<char> all_but_the_first(found->y_from_x.size(), 1);
  all_but_the_first[0] = 0;
  EXPECT_EQ(found->matched_y, all_but_the_first);
  EXPECT_THAT(found->warnings_x, Contains(HasSubstr("on no face")));
  const std::vector<Landmark> on_lone = {{0, 5}};
  EXPECT_THAT(Match(mesh, mesh, on_lone, QuickOptions()).status(),
              StatusIs(kInvalid, HasSubstr("landmarks[0].x")));
}

TEST(MatcherTest, SmallComponentsFollowWhatIsNear) {
  const TriangleMesh body = FiveArms(3);
  TriangleMesh crumb = Tetrahedron();
  crumb.positions *= 0.01;
  crumb.positions.rowwise() += 1.02 * body.positions.row(40);
  TriangleMesh both;
  both.positions.resize(646, 3);
  both.positions << body.positions, crumb.positions;
  both.faces.resize(body.num_faces() + 4, 3);
  both.faces << body.faces, (crumb.faces.array() + 642).matrix();
  const auto found = Match(both, body, {}, QuickOptions());
  ASSERT_THAT(found, IsOk());
  for (int v = 642; v < 646; ++v) {
    EXPECT_LT((body.positions.row(found->y_from_x[v]) - body.positions.row(40))
                  .norm(),
              0.2);
  }
  EXPECT_THAT(found->warnings_x, Contains(HasSubstr("components")));
}

TEST(MatcherTest, AComponentWithoutAreaIsNotTheLargestWhateverItsVertices) {
  // 200 points on a line, and a tetrahedron.
  TriangleMesh mesh;
  mesh.positions.resize(204, 3);
  mesh.faces.resize(198 + 4, 3);
  for (int v = 0; v < 200; ++v) mesh.positions.row(v) << v, 0, 0;
  for (int f = 0; f < 198; ++f) mesh.faces.row(f) << f, f + 1, f + 2;
  mesh.positions.bottomRows(4) = Tetrahedron().positions;
  mesh.faces.bottomRows(4) = (Tetrahedron().faces.array() + 200).matrix();
  const auto found = Match(mesh, Tetrahedron(), {}, QuickOptions());
  ASSERT_THAT(found, IsOk());
  EXPECT_EQ(VertexMap(found->y_from_x.end() - 4, found->y_from_x.end()),
            (VertexMap{0, 1, 2, 3}));
}

TEST(MatcherTest, ManyEqualComponentsAllGetATarget) {
  constexpr int kParts = 300;
  TriangleMesh mesh;
  mesh.positions.resize(4 * kParts, 3);
  mesh.faces.resize(4 * kParts, 3);
  for (int p = 0; p < kParts; ++p) {
    mesh.positions.middleRows(4 * p, 4) = Tetrahedron().positions;
    mesh.positions.middleRows(4 * p, 4).rowwise() +=
        Eigen::RowVector3d(3 * p, 0, 0);
    mesh.faces.middleRows(4 * p, 4) =
        (Tetrahedron().faces.array() + 4 * p).matrix();
  }
  const auto found = Match(mesh, mesh, {}, QuickOptions());
  ASSERT_THAT(found, IsOk());
  EXPECT_THAT(found->y_from_x, testing::Each(testing::Ge(0)));
  EXPECT_THAT(found->warnings_x,
              Contains(HasSubstr("follow the nearest larger one")));
}

TEST(MatcherTest, TwoLargeComponentsAreBothMatched) {
  TriangleMesh two;
  const TriangleMesh parts[] = {FiveArms(3), BumpySphere(2)};
  two.positions.resize(642 + 162, 3);
  two.positions << parts[0].positions,
      (parts[1].positions.array() + 9).matrix();
  two.faces.resize(parts[0].num_faces() + parts[1].num_faces(), 3);
  two.faces << parts[0].faces, (parts[1].faces.array() + 642).matrix();
  const auto found = Match(two, two, {}, QuickOptions());
  ASSERT_THAT(found, IsOk());
  int same_part = 0;
  for (int v = 0; v < 804; ++v) {
    same_part += (v < 642) == (found->y_from_x[v] < 642);
  }
  EXPECT_GT(same_part, 0.95 * 804);
}

TEST(MatcherTest, RefusesBadMeshesAndOptions) {
  const TriangleMesh good = FiveArms(2);
  TriangleMesh bad = good;
  bad.positions(7, 2) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(Match(bad, good, {}, {}).status(),
              StatusIs(kInvalid, HasSubstr("mesh_x")));
  EXPECT_THAT(Match(good, bad, {}, {}).status(),
              StatusIs(kInvalid, HasSubstr("mesh_y")));
  EXPECT_THAT(Match(good, {}, {}, {}).status(),
              StatusIs(kInvalid, HasSubstr("mesh_y: 0 vertices")));
  MatchOptions options;
  options.kernel_width = 0;
  EXPECT_THAT(Match(good, good, {}, options).status(),
              StatusIs(kInvalid, HasSubstr("options.kernel_width")));
}

TEST(MatcherTest, RefusesFacesBetweenAnyVertices) {
  const TriangleMesh any = AnyFaces(4000);
  const TriangleMesh sphere = UnitSphere(4);
  const auto refused = [](const std::string& field) {
    return StatusIs(kInvalid, HasSubstr(field + ": connected as no surface"));
  };
  EXPECT_THAT(Match(any, sphere, {}, {}), refused("mesh_x"));
  EXPECT_THAT(Match(sphere, any, {}, {}), refused("mesh_y"));
  EXPECT_THAT(Prepare(any, {}), refused("mesh"));
}

std::size_t PlaceOf(Stage stage) {
  return static_cast<std::size_t>(
      std::find(std::begin(kStages), std::end(kStages), stage) -
      std::begin(kStages));
}

TEST(MatcherTest, ProgressRisesThroughTheStagesToOne) {
  for (const Profile profile : kProfiles) {
    std::vector<Progress> seen;
    ASSERT_THAT(Match(FiveArms(3), FiveArms(3), {}, QuickOptionsOf(profile),
                      {[&](const Progress& p) { seen.push_back(p); }}),
                IsOk());
    ASSERT_FALSE(seen.empty());
    EXPECT_EQ(seen.front().total_fraction, 0);
    EXPECT_NEAR(seen.back().total_fraction, 1, 1e-9);
    for (std::size_t i = 1; i < seen.size(); ++i) {
      EXPECT_GE(seen[i].total_fraction, seen[i - 1].total_fraction);
      if (seen[i].stage == seen[i - 1].stage) continue;
      EXPECT_GT(PlaceOf(seen[i].stage), PlaceOf(seen[i - 1].stage));
      EXPECT_EQ(seen[i - 1].stage_fraction, 1);
      EXPECT_EQ(seen[i].stage_fraction, 0);
    }
  }
}

TEST(MatcherTest, StageMapsAreKeptOnRequest) {
  MatchOptions options = QuickOptionsOf(Profile::kPaper);
  options.keep_stage_maps = true;
  const auto found = Match(FiveArms(3), FiveArms(3), {}, options);
  ASSERT_THAT(found, IsOk());
  std::vector<Stage> stages;
  for (const StageMap& map : found->stage_maps) stages.push_back(map.stage);
  EXPECT_EQ(stages,
            (std::vector<Stage>{Stage::kFirstInsertion, Stage::kSecondInsertion,
                                Stage::kFinalSwapping, Stage::kZoomOut,
                                Stage::kQuality}));
  const auto matched = [](const VertexMap& map) {
    return map.size() - std::count(map.begin(), map.end(), kNoVertex);
  };
  EXPECT_EQ(matched(found->stage_maps[0].y_from_x), 80u);
  EXPECT_EQ(matched(found->stage_maps[1].y_from_x), std::size_t(0.7 * 642));
  EXPECT_EQ(found->stage_maps[3].y_from_x, found->y_from_x);
  EXPECT_EQ(found->stage_maps[4].y_from_x, found->y_from_x);
}

TEST(MatcherTest, StopsPromptlyInEveryStage) {
  for (const Profile profile : kProfiles) {
    for (std::size_t stage = 0; stage + 1 < std::size(kStages); ++stage) {
      std::stop_source stop;
      bool reached = false;
      int later_stages = 0;
      const auto result =
          Match(FiveArms(3), FiveArms(3), {}, QuickOptionsOf(profile),
                {[&](const Progress& p) {
                   if (PlaceOf(p.stage) == stage) {
                     reached = true;
                     stop.request_stop();
                   }
                   later_stages += reached && PlaceOf(p.stage) > stage + 1;
                 },
                 stop.get_token()});
      if (!reached) continue;  // not a stage of this profile
      EXPECT_THAT(result.status(),
                  StatusIs(absl::StatusCode::kCancelled, testing::_))
          << StageName(kStages[stage]);
      EXPECT_EQ(later_stages, 0) << StageName(kStages[stage]);
    }
  }
}

TEST(RealMeshTest, TwoPosesOfABodyAreMatchedTheRightWayRound) {
  const char* const given = std::getenv("ISOMATCH_DATA");
  const std::string dir = given != nullptr ? given : ISOMATCH_TEST_DATA;
  const TwoPoses poses = ReadTwoPoses(dir);
  ASSERT_FALSE(poses.truth.empty()) << dir;
  const auto found = Match(poses.x, poses.y, {}, {});
  ASSERT_THAT(found, IsOk());
  EXPECT_LT(poses.ErrorOf(found->y_from_x), 0.02);
  EXPECT_GT(found->scores.orientation_score, 0.5);
}

}  // namespace
}  // namespace isomatch
