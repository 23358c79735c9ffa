// What `isomatch match` writes and says, with a server whose method the test
// controls, and with the real one.

#include "client/cli/match_outputs.h"

#include <algorithm>
#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "client/files/map_file.h"
#include "client/files/mesh_file.h"
#include "client/files/ply_file.h"
#include "client/files/point_file.h"
#include "client/files/text_file.h"
#include "client/files/vertex_colors.h"
#include "tests/client/cli/run_isomatch.h"
#include "tests/server/test_server.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

class MatchOutputsTest : public TestServer {
 protected:
  /// Matches files X to Y with the server of the test and these options.
  CommandOutcome Match(std::vector<std::string> options) {
    WriteMeshes(UnitSphere(1), Tetrahedron());
    options.insert(options.end(), {"--server", server_->address()});
    return MatchFiles(options);
  }

  /// The same with the real method, in this process.
  CommandOutcome MatchEmbedded(const TriangleMesh& mesh_x,
                               const TriangleMesh& mesh_y,
                               const std::vector<std::string>& options) {
    WriteMeshes(mesh_x, mesh_y);
    return MatchFiles(options);
  }

  void WriteMeshes(const TriangleMesh& mesh_x, const TriangleMesh& mesh_y) {
    ASSERT_THAT(WriteMesh(Path("x.off"), mesh_x), IsOk());
    ASSERT_THAT(WriteMesh(Path("y.off"), mesh_y), IsOk());
  }

  CommandOutcome MatchFiles(const std::vector<std::string>& options) {
    std::vector<std::string> arguments = {"match",       Path("x.off"),
                                          Path("y.off"), "-o",
                                          Path("map"),   "--no-progress"};
    arguments.insert(arguments.end(), options.begin(), options.end());
    return RunIsomatch(arguments);
  }

  std::string Path(const std::string& name) const { return folder_.Path(name); }
  bool Exists(const std::string& name) const {
    return std::filesystem::exists(Path(name));
  }

  /// The numbers of a file, by lines.
  std::vector<std::vector<double>> Lines(const std::string& name) const {
    std::istringstream text(*ReadFile(Path(name), "numbers"));
    std::vector<std::vector<double>> lines;
    for (std::string line; std::getline(text, line);) {
      std::istringstream words(line);
      lines.emplace_back();
      for (double number; words >> number;) lines.back().push_back(number);
    }
    return lines;
  }

  json Json(const std::string& name) const {
    return json::parse(*ReadFile(Path(name), "JSON"));
  }

  TemporaryFolder folder_;
};

TEST_F(MatchOutputsTest, EachFileHoldsWhatTheServerFound) {
  on_found_ = FindEverything;
  const CommandOutcome outcome =
      Match({"--precise", Path("p"), "--confidence", Path("c"), "--alternative",
             Path("a"), "--functional-map", Path("f"), "--mask-y", Path("m"),
             "--report", Path("r")});
  ASSERT_EQ(outcome.status, kExitSuccess) << outcome.err;
  EXPECT_EQ((*ReadMap(Path("map"), 4))[7], 3);
  EXPECT_EQ((*ReadMap(Path("a"), 4))[7], 0);
  EXPECT_EQ(Lines("c").size(), 42);
  EXPECT_EQ(Lines("c")[8], std::vector<double>{0.1});
  EXPECT_EQ(*ReadFile(Path("m"), "a mask"), "1\n0\n1\n1\n");
  EXPECT_EQ(Json("f")["matrix"], json::parse("[[1.0, 2.0], [3.0, 4.0]]"));
  // Vertex 6 is at the vertices 2, 3, 0 with weights 4/8, 3/8, 1/8.
  const TriangleMesh y = Tetrahedron();
  const std::vector<double> point = Lines("p").at(6);
  ASSERT_EQ(point.size(), 4);
  const double weight_of_vertex[] = {0.125, 0, 0.5, 0.375};
  for (int corner = 0; corner < 3; ++corner) {
    const VertexIndex v = y.faces(static_cast<Eigen::Index>(point[0]), corner);
    EXPECT_EQ(point[static_cast<size_t>(corner) + 1], weight_of_vertex[v]);
  }
}

TEST_F(MatchOutputsTest, MapsHaveTheFormatOfTheirExtension) {
  on_found_ = FindEverything;
  WriteMeshes(UnitSphere(1), Tetrahedron());
  const auto match = [&](const std::string& map, const std::string& other,
                         std::vector<std::string> options) {
    options.insert(options.begin(),
                   {"match", Path("x.off"), Path("y.off"), "-o", Path(map),
                    "--alternative", Path(other), "--no-progress", "--server",
                    server_->address()});
    return RunIsomatch(options).status;
  };
  ASSERT_EQ(match("map.npy", "other.json", {}), kExitSuccess);
  EXPECT_EQ((*ReadMap(Path("map.npy"), 4, 42))[7], 3);
  EXPECT_EQ((*ReadMap(Path("other.json"), 4, 42))[7], 0);
  // Only the map chosen has a confidence.
  ASSERT_EQ(match("map.ply", "other.ply", {"--confidence", Path("c")}),
            kExitSuccess);
  EXPECT_THAT(*ReadFile(Path("map.ply"), "a map"),
              HasSubstr("property float confidence\n"));
  const std::string other = *ReadFile(Path("other.ply"), "a map");
  EXPECT_THAT(other, HasSubstr("property int y_index\n"));
  EXPECT_THAT(other, Not(HasSubstr("confidence")));
}

TEST_F(MatchOutputsTest, NoMeshIsOverwritten) {
  WriteMeshes(UnitSphere(1), Tetrahedron());
  // Under a name that --precise may have.
  std::filesystem::create_symlink(Path("y.off"), Path("y.txt"));
  const CommandOutcome outcome = MatchFiles({"--precise", Path("y.txt")});
  EXPECT_EQ(outcome.status, kExitUsage);
  EXPECT_THAT(outcome.err, HasSubstr("--precise '" + Path("y.txt") +
                                     "': is a file that is read too"));
  EXPECT_THAT(ReadMesh(Path("y.off"), "Y"), IsOk());
}

TEST_F(MatchOutputsTest, ColorsThatCannotBeReadDoNotStopAMatch) {
  on_found_ = FindEverything;
  WriteMeshes(UnitSphere(1), Tetrahedron());
  folder_.Write("y.obj",
                "v 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
                "f 1 2 3\nf 1 3 4\nf 1 4 2\nf 2 4 3\n");
  const CommandOutcome outcome =
      RunIsomatch({"match", Path("x.off"), Path("y.obj"), "-o", Path("m.ply"),
                   "--no-progress", "--server", server_->address()});
  EXPECT_EQ(outcome.status, kExitSuccess);
  EXPECT_THAT(outcome.err, HasSubstr("3 of 4 vertices have no color"));
  EXPECT_TRUE(Exists("m.ply"));
}

TEST_F(MatchOutputsTest, AMapInColorsTakesThoseOfY) {
  on_found_ = FindEverything;
  const TriangleMesh y = Tetrahedron();
  const Colors red = Eigen::RowVector3d(1, 0, 0).replicate(4, 1);
  WriteMeshes(UnitSphere(1), y);
  folder_.Write("y.ply", FormatPly(y, ColorColumns(red)));
  const std::string map = Path("map.ply");
  ASSERT_EQ(RunIsomatch({"match", Path("x.off"), Path("y.ply"), "-o", map,
                         "--no-progress", "--server", server_->address()})
                .status,
            kExitSuccess);
  const absl::StatusOr<LoadedMesh> loaded = ReadMesh(map, "MAP");
  ASSERT_THAT(loaded, IsOk());
  ASSERT_TRUE(loaded->colors.ok() && loaded->colors->has_value());
  EXPECT_EQ((*loaded->colors)->row(7), Eigen::RowVector3d(1, 0, 0));
}

TEST_F(MatchOutputsTest, TheReportTellsHowGoodTheMapIs) {
  on_found_ = FindEverything;
  const std::string landmarks = folder_.Write("lm", "12 2\n13 3\n");
  ASSERT_EQ(Match({"--report", Path("r"), "--landmarks", landmarks}).status,
            kExitSuccess);
  const json report = Json("r");
  EXPECT_EQ(report["scores"]["embedding_error"], 1);
  EXPECT_EQ(report["scores"]["rank_value"], 7);
  EXPECT_EQ(report["quality"]["geodesic_distortion"], 0.125);
  EXPECT_GT(report["quality"]["mean_confidence"], 0);
  EXPECT_EQ(report["symmetry_confidence"], 0.125);
  ASSERT_EQ(report["alternatives"].size(), 2);
  EXPECT_EQ(report["alternatives"][0]["scores"]["stretch"], 12);
  EXPECT_EQ(report["landmarks"], json::parse(R"([
      {"x": 12, "y": 2, "kept": true, "y_found": 2, "distance": 0.5},
      {"x": 13, "y": 3, "kept": false, "y_found": 3, "distance": 0.5}])"));
}

TEST_F(MatchOutputsTest, OnlyANearlyAsGoodAlternativeIsWarnedOf) {
  double confidence = 0;
  on_found_ = [&](auto&& landmarks, auto&& options, Correspondence& found) {
    FindEverything(landmarks, options, found);
    found.symmetry_confidence = confidence;
    if (confidence == 0) found.alternatives.clear();
  };
  confidence = 0.19;
  EXPECT_THAT(Match({}).err, HasSubstr("may be a symmetric image"));
  confidence = 0.21;
  EXPECT_THAT(Match({}).err, Not(HasSubstr("warning")));
  confidence = 0;  // as of a server that tells of no alternatives
  EXPECT_THAT(Match({}).err, Not(HasSubstr("warning")));
}

TEST_F(MatchOutputsTest, WithoutAnAlternativeThereIsAWarningAndNoFile) {
  const CommandOutcome outcome = Match({"--alternative", Path("a")});
  EXPECT_EQ(outcome.status, kExitSuccess);
  EXPECT_THAT(outcome.err, HasSubstr("no other map came near"));
  EXPECT_FALSE(Exists("a"));
  EXPECT_TRUE(Exists("map"));
}

TEST_F(MatchOutputsTest, APartThatTheServerDoesNotKnowIsAnErrorAfterTheMap) {
  const CommandOutcome outcome = Match({"--precise", Path("p")});
  EXPECT_EQ(outcome.status, kExitFailure);
  EXPECT_THAT(outcome.err, HasSubstr("expected a newer isomatch-server"));
  EXPECT_FALSE(Exists("p"));
  EXPECT_TRUE(Exists("map"));
}

TEST_F(MatchOutputsTest, FlagsReachTheMethod) {
  MatchOptions seen;
  on_found_ = [&](auto&& landmarks, const MatchOptions& options,
                  Correspondence& found) {
    FindEverything(landmarks, options, found);
    found.relation = options.relation;
    seen = options;
  };
  Match({});
  EXPECT_FALSE(seen.landmarks_exact);
  EXPECT_FALSE(seen.keep_functional_map);
  Match({"--landmarks-exact"});
  EXPECT_TRUE(seen.landmarks_exact);
  Match({"--functional-map", Path("f")});
  EXPECT_TRUE(seen.keep_functional_map);
  EXPECT_EQ(seen.relation, Relation::kWhole);
  for (const Relation relation : kRelations) {
    const LengthScale scale = relation == Relation::kOverlap
                                  ? LengthScale::kSame
                                  : LengthScale::kAuto;
    Match({"--relation", RelationName(relation), "--scale",
           LengthScaleName(scale), "--report", Path("r")});
    EXPECT_EQ(seen.scale, scale);
    EXPECT_EQ(seen.relation, relation);
    EXPECT_EQ(Json("r")["relation"], RelationName(relation));
  }
  Match({"--relation", "part-of-y", "--scale", "same"});
  EXPECT_EQ(seen.scale, LengthScale::kSame);
  const CommandOutcome refused = Match({"--scale", "same"});
  EXPECT_EQ(refused.status, kExitUsage);
  EXPECT_THAT(refused.err, HasSubstr("--scale: same, expected auto with"));
  const CommandOutcome no_unit = Match({"--relation", "overlap"});
  EXPECT_EQ(no_unit.status, kExitUsage);
  EXPECT_THAT(no_unit.err, HasSubstr("--scale: auto, expected same with"));
}

TEST_F(MatchOutputsTest, PointsOfBothShapesBecomeLandmarks) {
  std::vector<VertexMatch> seen;
  on_found_ = [&](auto&& landmarks, auto&& options, Correspondence& found) {
    FindEverything(landmarks, options, found);
    seen.assign(landmarks.begin(), landmarks.end());
  };
  const TriangleMesh x = UnitSphere(1);
  const auto at = [](const TriangleMesh& mesh, VertexIndex v) {
    return Eigen::RowVector3d(mesh.positions.row(v));
  };
  const std::string points_x = folder_.Write(
      "x.mrk.json", FormatPoints("x.mrk.json", "LPS",
                                 std::vector<LandmarkPoint>{{at(x, 12), "a"},
                                                            {at(x, 13), "b"}}));
  const std::string points_y = folder_.Write(
      "y.fcsv",
      FormatPoints("y.fcsv", "LPS",
                   std::vector<LandmarkPoint>{{at(Tetrahedron(), 3), "b"},
                                              {at(Tetrahedron(), 2), "a"}}));
  const CommandOutcome outcome =
      Match({"--landmarks-x", points_x, "--landmarks-y", points_y});
  ASSERT_EQ(outcome.status, kExitSuccess) << outcome.err;
  ASSERT_EQ(seen.size(), 2u);
  EXPECT_TRUE(seen[0].x == 12 && seen[0].y == 2);
  EXPECT_TRUE(seen[1].x == 13 && seen[1].y == 3);
  // --no-progress says nothing of the distances.
  EXPECT_THAT(outcome.err, Not(HasSubstr("landmarks on X")));
  // What the page of `isomatch view` exports.
  ASSERT_EQ(Match({"--landmarks",
                   folder_.Write("lm.txt",
                                 "# Isomatch: pairs of the viewer\n# X x.off\n"
                                 "# Y y.off\n13 3\n12 2\n")})
                .status,
            kExitSuccess);
  ASSERT_EQ(seen.size(), 2u);
  EXPECT_TRUE(seen[0].x == 13 && seen[0].y == 3);
  const CommandOutcome mixed = Match({"--landmarks", points_x});
  EXPECT_EQ(mixed.status, kExitUsage);
  EXPECT_THAT(mixed.err, HasSubstr("expected lines `x y`, or --landmarks-x"));
  EXPECT_THAT(Match({"--landmarks-x", points_x}).err,
              HasSubstr("--landmarks-x requires --landmarks-y"));
}

TEST_F(MatchOutputsTest, ChangedLandmarksAreSaidInOneLine) {
  on_found_ = [](auto&&, auto&&, Correspondence& found) {
    found.warnings = {"2 of 5 landmarks contradict the rest"};
  };
  EXPECT_EQ(Match({}).err,
            "isomatch: warning: 2 of 5 landmarks contradict the rest\n");
}

TEST_F(MatchOutputsTest, BadPathsAreRefusedBeforeTheRun) {
  for (const char* option : {"--precise", "--confidence", "--alternative",
                             "--functional-map", "--mask-y", "--report"}) {
    const CommandOutcome lost = Match({option, Path("no/file")});
    EXPECT_EQ(lost.status, kExitUsage) << option;
    EXPECT_THAT(lost.err, HasSubstr("there is no folder")) << option;
    const CommandOutcome same = Match({option, Path("./map")});
    EXPECT_EQ(same.status, kExitUsage) << option;
    EXPECT_THAT(same.err, HasSubstr("is the file of --output too")) << option;
  }
  EXPECT_THAT(Match({"--precise", Path("f"), "--report", Path("f")}).err,
              HasSubstr("is the file of --report too"));
  EXPECT_EQ(matches_, 0);
  EXPECT_EQ(folder_.CountFiles(), 2);
}

TEST_F(MatchOutputsTest, ADeviceMayBeWrittenTwice) {
  on_found_ = FindEverything;
  EXPECT_EQ(
      Match({"--precise", "/dev/null", "--confidence", "/dev/null"}).status,
      kExitSuccess);
}

TEST_F(MatchOutputsTest, ThePlacesOfTheRealMethodAreNearItsMap) {
  const TriangleMesh mesh_y = Moved(BumpySphere(3), 3);
  const CommandOutcome outcome =
      MatchEmbedded(BumpySphere(3), mesh_y,
                    {"--precise", Path("p"), "--confidence", Path("c"),
                     "--functional-map", Path("f"), "--mask-y", Path("m")});
  ASSERT_EQ(outcome.status, kExitSuccess) << outcome.err;
  double longest_edge = 0;
  for (VertexIndex f = 0; f < mesh_y.num_faces(); ++f) {
    for (int corner = 0; corner < 3; ++corner) {
      const auto edge = mesh_y.positions.row(mesh_y.faces(f, corner)) -
                        mesh_y.positions.row(mesh_y.faces(f, (corner + 1) % 3));
      longest_edge = std::max(longest_edge, edge.norm());
    }
  }
  const VertexMap map = *ReadMap(Path("map"), mesh_y.num_vertices());
  const auto points = Lines("p");
  ASSERT_EQ(points.size(), map.size());
  for (std::size_t x = 0; x < map.size(); ++x) {
    ASSERT_EQ(points[x].size(), 4);
    const auto face = static_cast<VertexIndex>(points[x][0]);
    ASSERT_TRUE(0 <= face && face < mesh_y.num_faces()) << face;
    Eigen::RowVector3d position = Eigen::RowVector3d::Zero();
    double sum = 0;
    for (int corner = 0; corner < 3; ++corner) {
      const double weight = points[x][static_cast<std::size_t>(corner) + 1];
      sum += weight;
      position += weight * mesh_y.positions.row(mesh_y.faces(face, corner));
    }
    EXPECT_NEAR(sum, 1, 1e-6);
    EXPECT_LT((position - mesh_y.positions.row(map[x])).norm(), longest_edge);
  }
  for (const std::vector<double>& line : Lines("c")) {
    ASSERT_EQ(line.size(), 1);
    EXPECT_TRUE(0 <= line[0] && line[0] <= 1) << line[0];
  }
  EXPECT_EQ(Lines("m"), std::vector<std::vector<double>>(
                            std::size_t(mesh_y.num_vertices()), {1}));
  EXPECT_EQ(Json("f")["matrix"].size(), Json("f")["eigenvalues_y"].size());
  EXPECT_GT(Json("f")["matrix"].size(), 1);
}

TEST_F(MatchOutputsTest, AWrongLandmarkIsChangedUnlessItIsExact) {
  const TriangleMesh mesh = BumpySphere(3);
  // The last one is far from the truth, which is the vertex itself.
  Eigen::Index far = 0;
  (mesh.positions.rowwise() - mesh.positions.row(7))
      .rowwise()
      .norm()
      .maxCoeff(&far);
  const std::string landmarks = folder_.Write(
      "lm", absl::StrCat("0 0\n1 1\n2 2\n3 3\n4 4\n5 5\n7 ", far, "\n"));
  const CommandOutcome changed = MatchEmbedded(
      mesh, mesh, {"--landmarks", landmarks, "--report", Path("r")});
  ASSERT_EQ(changed.status, kExitSuccess) << changed.err;
  EXPECT_THAT(changed.err, HasSubstr("1 of 7 landmarks"));
  EXPECT_NE((*ReadMap(Path("map"), mesh.num_vertices()))[7], far);
  EXPECT_EQ(Json("r")["landmarks"][6]["kept"], false);
  EXPECT_EQ(Json("r")["landmarks"][0]["kept"], true);
  const CommandOutcome exact = MatchEmbedded(
      mesh, mesh, {"--landmarks", landmarks, "--landmarks-exact"});
  ASSERT_EQ(exact.status, kExitSuccess) << exact.err;
  EXPECT_THAT(exact.err, Not(HasSubstr("landmarks")));
  EXPECT_EQ((*ReadMap(Path("map"), mesh.num_vertices()))[7], far);
}

}  // namespace
}  // namespace isomatch
