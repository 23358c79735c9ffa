#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "client/files/map_file.h"
#include "client/files/mesh_file.h"
#include "client/files/point_file.h"
#include "client/files/text_file.h"
#include "client/files/vertex_colors.h"
#include "core/mesh/surface_point.h"
#include "tests/client/cli/run_isomatch.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::AllOf;
using testing::HasSubstr;

/// Pose A of 600 vertices, pose B of 500 with a pattern, the true map.
class TransferCommandTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(Run({"sample", "--vertices", "600", "-o", x_}).status, 0);
    ASSERT_EQ(
        Run({"sample", "--pose", "B", "--vertices", "500", "--texture",
             "checker", "-o", y_, "--truth-from", "A:600", "--truth", map_})
            .status,
        0);
  }
  CommandOutcome Run(const std::vector<std::string>& arguments) {
    return RunIsomatch(arguments);
  }
  CommandOutcome Transfer(std::vector<std::string> options) {
    options.insert(options.begin(), {"transfer", x_, y_, map_});
    return Run(options);
  }
  void ExpectUsageError(const CommandOutcome& outcome, const std::string& why) {
    EXPECT_EQ(outcome.status, kExitUsage) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(why));
  }
  std::string Content(const std::string& path) {
    return *ReadFile(path, "an output");
  }

  TemporaryFolder folder_;
  const std::string x_ = folder_.Path("x.off");
  const std::string y_ = folder_.Path("y.obj");
  const std::string map_ = folder_.Path("map.txt");
  const std::string out_ = folder_.Path("out.obj");
};

TEST_F(TransferCommandTest, HelpHasExamples) {
  const CommandOutcome outcome = Run({"transfer", "--help"});
  EXPECT_EQ(outcome.status, 0);
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("Examples:"), HasSubstr("OUT.obj"),
                                 HasSubstr("--landmarks")));
}

TEST_F(TransferCommandTest, ATextureGoesFromPoseToPose) {
  const CommandOutcome outcome = Transfer({"-o", out_});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("texture coordinates: 1196 of 1196"));
  EXPECT_EQ(outcome.err, "");
  EXPECT_THAT(Content(out_), AllOf(HasSubstr("mtllib y.mtl\n"),
                                   HasSubstr("usemtl pattern\n")));
  EXPECT_THAT(Content(folder_.Path("y.mtl")), HasSubstr("map_Kd y.png"));
  const absl::StatusOr<LoadedMesh> x = ReadMesh(x_, "X");
  const absl::StatusOr<LoadedMesh> out = ReadMesh(out_, "OUT");
  ASSERT_THAT(out, IsOk());
  EXPECT_EQ(out->mesh.positions, x->mesh.positions);
  EXPECT_EQ(out->mesh.faces, x->mesh.faces);
  EXPECT_TRUE(out->texture->has_value());
}

TEST_F(TransferCommandTest, OneGlbFileHasTheTextureAndItsPicture) {
  const std::string glb = folder_.Path("out.glb");
  const CommandOutcome outcome = Transfer({"-o", glb});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  const std::string bytes = Content(glb);
  const std::string png = Content(folder_.Path("y.png"));
  EXPECT_NE(bytes.find(png), std::string::npos);
  ASSERT_EQ(Transfer({"-o", out_}).status, 0);
  const LoadedMesh obj = *ReadMesh(out_, "OBJ");
  const LoadedMesh out = *ReadMesh(glb, "OUT");
  EXPECT_EQ(out.mesh.positions.topRows(600),
            obj.mesh.positions.cast<float>().cast<double>());
  ASSERT_EQ(out.mesh.num_faces(), obj.mesh.num_faces());
  const MeshTexture& from = **obj.texture;
  const MeshTexture& to = **out.texture;
  for (VertexIndex f = 0; f < out.mesh.num_faces(); ++f) {
    for (int i = 0; i < 3; ++i) {
      // In single precision, v from the other side.
      ASSERT_LT((to.coordinates.row(to.corners(f, i)) -
                 from.coordinates.row(from.corners(f, i)))
                    .norm(),
                1e-6);
    }
  }
  // Y may be such a file, too.
  const std::string again = folder_.Path("again.glb");
  std::string identity;
  for (VertexIndex v = 0; v < out.mesh.num_vertices(); ++v) {
    identity += std::to_string(v) + "\n";
  }
  ASSERT_EQ(Run({"transfer", glb, glb, folder_.Write("id.txt", identity), "-o",
                 again})
                .status,
            0);
  EXPECT_NE(Content(again).find(png), std::string::npos);
  ASSERT_EQ(Transfer({"-o", again}).status, 0);
  EXPECT_EQ(Content(again), bytes);
}

TEST_F(TransferCommandTest, ColorsGoFromPoseToPose) {
  const std::string y = folder_.Path("y.ply");
  const std::string out = folder_.Path("out.ply");
  ASSERT_EQ(Run({"sample", "--pose", "B", "--vertices", "500", "--texture",
                 "stripes", "-o", y})
                .status,
            0);
  const CommandOutcome outcome = Run({"transfer", x_, y, map_, "-o", out});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("vertex colors: 600 of 600"));
  const Colors from = **ReadMesh(y, "Y")->colors;
  const Colors to = **ReadMesh(out, "OUT")->colors;
  const VertexMap map = *ReadMap(map_, 500, 600);
  for (std::size_t x = 0; x < map.size(); ++x) {
    ASSERT_EQ(to.row(static_cast<Eigen::Index>(x)), from.row(map[x]));
  }
}

TEST_F(TransferCommandTest, LabelsGoAlongAndTheMissingAreToldOf) {
  std::string labels;
  for (int y = 0; y < 500; ++y) labels += std::to_string(1000 + y) + "\n";
  VertexMap map = *ReadMap(map_, 500);
  map[3] = kNoVertex;
  folder_.Write("map.txt", FormatMap(map));
  const std::string out = folder_.Path("labels.npy");
  const CommandOutcome outcome =
      Transfer({"--labels", folder_.Write("y.txt", labels), "-o", out,
                "--missing", "7"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("labels: 599 of 600 vertices"));
  EXPECT_THAT(outcome.err, HasSubstr("1 of 600 vertices of X have no place on "
                                     "Y: their label is 7"));
  const std::vector<std::int64_t> carried = *ReadLabels(out, 600);
  EXPECT_EQ(carried[3], 7);
  EXPECT_EQ(carried[4], 1000 + map[4]);
}

/// The front of X has no place on Y, as where Y is a part of X.
class TransferPartTest : public TransferCommandTest {
 protected:
  void SetUp() override {
    TransferCommandTest::SetUp();
    mesh_x_ = ReadMesh(x_, "X")->mesh;
    whole_ = ReadMap(map_, 500).value();
    part_ = whole_;
    std::string places;
    for (std::size_t v = 0; v < part_.size(); ++v) {
      const bool is_gone =
          mesh_x_.positions(static_cast<Eigen::Index>(v), 0) > 0.3;
      if (is_gone) part_[v] = kNoVertex;
      places += is_gone ? "-1 0 0 0\n" : "0 0.5 0.25 0.25\n";
    }
    unmatched_ = std::count(part_.begin(), part_.end(), kNoVertex);
    ASSERT_GT(unmatched_, 100);
    files_ = {folder_.Write("m.txt", FormatMap(part_)),
              folder_.Write("m.npy", FormatMap(part_, 500, MapFormat::kNpy)),
              folder_.Write("m.json", FormatMap(part_, 500, MapFormat::kJson)),
              folder_.Write("places.txt", places)};
  }
  bool IsGone(VertexIndex v) const {
    return part_[static_cast<std::size_t>(v)] == kNoVertex;
  }
  std::string Told(const std::string& what) const {
    return std::to_string(unmatched_) +
           " of 600 vertices of X have no place on Y: " + what;
  }

  TriangleMesh mesh_x_;
  VertexMap whole_;
  VertexMap part_;
  std::ptrdiff_t unmatched_ = 0;
  /// part_ in every format.
  std::vector<std::string> files_;
};

TEST_F(TransferPartTest, LabelsOfTheRestAreMissing) {
  std::string labels;
  for (int y = 0; y < 500; ++y) labels += std::to_string(1000 + y) + "\n";
  const std::string labels_y = folder_.Write("labels_y.txt", labels);
  const std::string out = folder_.Path("labels.txt");
  for (const std::string& file : files_) {
    const CommandOutcome outcome =
        Run({"transfer", x_, y_, file, "--labels", labels_y, "-o", out});
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(Told("their label is -1")));
    const std::vector<std::int64_t> carried = *ReadLabels(out, 600);
    for (VertexIndex v = 0; v < 600; ++v) {
      ASSERT_EQ(carried[static_cast<std::size_t>(v)] == -1, IsGone(v)) << file;
    }
  }
}

TEST_F(TransferPartTest, ColorsOfTheRestAreGray) {
  const std::string y = folder_.Path("y.ply");
  const std::string out = folder_.Path("out.ply");
  ASSERT_EQ(Run({"sample", "--pose", "B", "--vertices", "500", "--texture",
                 "checker", "-o", y})
                .status,
            0);
  for (const std::string& file : files_) {
    const CommandOutcome outcome = Run({"transfer", x_, y, file, "-o", out});
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(Told("they are gray")));
    const Colors colors = **ReadMesh(out, "OUT")->colors;
    for (VertexIndex v = 0; v < 600; ++v) {
      const bool is_gray = ColorBytes(colors.row(v)) == ColorBytes(kNoColor);
      ASSERT_EQ(is_gray, IsGone(v)) << file << " " << v;
    }
  }
}

TEST_F(TransferPartTest, FacesOfTheRestHaveNoTexture) {
  for (const std::string& file : files_) {
    const CommandOutcome outcome =
        Run({"transfer", x_, y_, file, "-o", out_, "--json"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const MeshTexture texture = **ReadMesh(out_, "OUT")->texture;
    int without = 0;
    for (VertexIndex f = 0; f < mesh_x_.num_faces(); ++f) {
      const auto face = mesh_x_.faces.row(f);
      const bool is_bare = texture.corners(f, 0) == -1;
      ASSERT_EQ(is_bare, IsGone(face[0]) || IsGone(face[1]) || IsGone(face[2]))
          << file << " " << f;
      without += is_bare;
    }
    const auto json = nlohmann::json::parse(outcome.out);
    EXPECT_EQ(json["unmatched"], unmatched_);
    EXPECT_EQ(json["texture"]["without"], without);
  }
}

TEST_F(TransferPartTest, LandmarksOfTheRestAreToldToBeFar) {
  VertexIndex foremost = 0;
  mesh_x_.positions.col(0).maxCoeff(&foremost);
  const std::string landmark =
      std::to_string(whole_[static_cast<std::size_t>(foremost)]) + " nose\n";
  const CommandOutcome outcome =
      Run({"transfer", x_, y_, files_[0], "--landmarks",
           folder_.Write("lm.txt", landmark), "-o", folder_.Path("lm_x.txt")});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.err,
              HasSubstr("expected less than 5; X may have no counterpart"));
}

TEST_F(TransferCommandTest, LandmarksGoAlongWithTheirNames) {
  const VertexMap map = *ReadMap(map_, 500);
  const std::string points = folder_.Write(
      "points.txt", std::to_string(map[42]) + " tip of the nose\n");
  const std::string out = folder_.Path("x_points.txt");
  const CommandOutcome outcome =
      Transfer({"--landmarks", points, "-o", out, "--json"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const auto json = nlohmann::json::parse(outcome.out);
  const int x = json["landmarks"][0]["x"];
  EXPECT_EQ(map[static_cast<std::size_t>(x)], map[42]);
  EXPECT_EQ(json["landmarks"][0]["distance"], 0);
  EXPECT_EQ(Content(out), std::to_string(x) + " tip of the nose\n");
}

TEST_F(TransferCommandTest, PointsGoAlongBetweenVertices) {
  // From Y to itself, by places: every point comes back.
  const LoadedMesh y = *ReadMesh(y_, "Y");
  std::vector<std::string> lines(500);
  std::vector<LandmarkPoint> points;
  for (VertexIndex f = 0; f < y.mesh.num_faces(); ++f) {
    const char* const weights[] = {" 1 0 0\n", " 0 1 0\n", " 0 0 1\n"};
    for (int i = 0; i < 3; ++i) {
      lines[static_cast<std::size_t>(y.mesh.faces(f, i))] =
          std::to_string(f) + weights[i];
    }
    if (f % 100 != 0) continue;
    points.push_back(
        {PositionOf(y.mesh, {f, {0.25, 0.25, 0.5}}), "p" + std::to_string(f)});
  }
  std::string places;
  for (const std::string& line : lines) places += line;
  const std::string p = folder_.Write("p.txt", places);
  for (const std::string name : {"o.mrk.json", "o.fcsv", "o.csv"}) {
    const std::string in =
        folder_.Write("in_" + name, FormatPoints(name, "", points));
    const std::string out = folder_.Path(name);
    const CommandOutcome outcome =
        Run({"transfer", y_, y_, p, "--landmarks", in, "-o", out});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_THAT(outcome.out, HasSubstr("landmarks on Y: 10 points, "));
    const PointFile found = *ReadPoints(out);
    ASSERT_EQ(found.points.size(), points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      EXPECT_LT((found.points[i].position - points[i].position).norm(), 1e-9);
      EXPECT_EQ(found.points[i].label, points[i].label);
    }
  }
}

TEST_F(TransferCommandTest, JsonTellsWhatWasCarried) {
  VertexMap map = *ReadMap(map_, 500);
  map[3] = kNoVertex;
  folder_.Write("map.txt", FormatMap(map));
  const CommandOutcome outcome = Transfer({"-o", out_, "--json"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const auto json = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(json["vertices"], 600);
  EXPECT_EQ(json["unmatched"], 1);
  EXPECT_EQ(json["precise"], false);
  EXPECT_EQ(json["texture"]["faces"], 1196);
  EXPECT_GT(json["texture"]["without"], 2);
  EXPECT_GT(json["texture"]["on_seams"], 0);
  EXPECT_EQ(json["warnings"].size(), 1u);
}

TEST_F(TransferCommandTest, PrecisePlacesInterpolate) {
  // Every vertex of X in the middle of face 0 of Y.
  std::string places;
  for (int x = 0; x < 600; ++x) places += "0 0.5 0.25 0.25\n";
  const CommandOutcome outcome =
      Run({"transfer", x_, y_, folder_.Write("p.txt", places), "-o", out_,
           "--json"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(nlohmann::json::parse(outcome.out)["precise"], true);
  const absl::StatusOr<LoadedMesh> y = ReadMesh(y_, "Y");
  const MeshTexture texture = **y->texture;
  const auto place = [&](int i) {
    return texture.coordinates.row(texture.corners(0, i)).eval();
  };
  const absl::StatusOr<LoadedMesh> out = ReadMesh(out_, "OUT");
  const MeshTexture carried = **out->texture;
  EXPECT_TRUE(
      carried.coordinates.row(carried.corners(5, 1))
          .isApprox(0.5 * place(0) + 0.25 * place(1) + 0.25 * place(2), 1e-12));
}

TEST_F(TransferCommandTest, WrongUseIsExplained) {
  ExpectUsageError(Transfer({}), "--output is required");
  ExpectUsageError(
      Transfer({"-o", folder_.Path("a.off")}),
      "the extension is '.off', expected .obj or .glb or .ply for a mesh");
  ExpectUsageError(Transfer({"-o", folder_.Path("a.txt")}),
                   "expected .obj or .glb or .ply");
  const std::string labels = folder_.Write("l.txt", "1\n2\n");
  ExpectUsageError(Transfer({"--labels", labels, "-o", out_}),
                   "expected .txt or .npy for labels");
  ExpectUsageError(Transfer({"--labels", labels, "-o", folder_.Path("a.txt")}),
                   "2 entries, expected 500, one for each vertex of Y");
  ExpectUsageError(Transfer({"--labels", labels, "--landmarks", labels, "-o",
                             folder_.Path("a.txt")}),
                   "expected one of them");
  ExpectUsageError(
      Transfer({"--landmarks", labels, "-o", folder_.Path("a.npy")}),
      "expected .txt or .json or .fcsv or .csv for landmarks");
  ExpectUsageError(Transfer({"-o", y_}), "is a file that is read too");
  ExpectUsageError(Transfer({"-o", folder_.Path("none/a.obj")}),
                   "there is no folder");
  ExpectUsageError(Transfer({"-o", folder_.Path("a.ply")}),
                   "texture coordinates only");
  ExpectUsageError(Run({"transfer", y_, x_, map_, "-o", out_}),
                   "600 entries, expected 500");
  ExpectUsageError(
      Run({"transfer", x_, x_,
           folder_.Write("id.txt", FormatMap(VertexMap(600, 0))), "-o", out_}),
      "has neither texture coordinates");
}

}  // namespace
}  // namespace isomatch
