#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "absl/strings/str_format.h"
#include "client/files/map_file.h"
#include "client/files/mesh_file.h"
#include "client/files/text_file.h"
#include "tests/client/cli/run_isomatch.h"
#include "tests/client/files/gzip.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

class ViewCommandTest : public testing::Test {
 protected:
  ViewCommandTest() {
    const TriangleMesh mesh = BumpySphere(1);  // 42 vertices
    EXPECT_THAT(WriteMesh(x_, mesh), IsOk());
    EXPECT_THAT(WriteMesh(y_, mesh), IsOk());
    std::string lines;
    for (int i = 0; i < mesh.num_vertices(); ++i) {
      lines += std::to_string(i) + "\n";
    }
    map_ = folder_.Write("map.txt", lines);
  }

  CommandOutcome View(std::vector<std::string> options) {
    std::vector<std::string> arguments = {"view", x_, y_, map_};
    arguments.insert(arguments.end(), options.begin(), options.end());
    return RunIsomatch(arguments);
  }

  void ExpectUsageError(const std::vector<std::string>& options,
                        const std::string& why) {
    const int files = folder_.CountFiles();
    const CommandOutcome outcome = View(options);
    EXPECT_EQ(outcome.status, kExitUsage) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(why));
    EXPECT_EQ(folder_.CountFiles(), files);
  }

  std::string Numbers(int count, const std::string& number) {
    std::string lines;
    for (int i = 0; i < count; ++i) lines += number + "\n";
    return lines;
  }

  TemporaryFolder folder_;
  const std::string x_ = folder_.Path("x.off");
  const std::string y_ = folder_.Path("y.off");
  const std::string page_ = folder_.Path("page.html");
  const std::string png_ = folder_.Path("picture.png");
  std::string map_;
};

TEST_F(ViewCommandTest, WritesAPageAndAPicture) {
  const CommandOutcome outcome =
      View({"-o", page_, "--png", png_, "--size", "200x100"});
  ASSERT_EQ(outcome.status, kExitSuccess) << outcome.err;
  EXPECT_EQ(outcome.out, "");
  EXPECT_EQ(outcome.err, "");
  const std::string page = ReadFile(page_, "a page").value();
  EXPECT_THAT(page, StartsWith("<!doctype html>"));
  EXPECT_THAT(page, HasSubstr("<title>x.off \u2192 y.off</title>"));
  EXPECT_THAT(ReadFile(png_, "a picture").value(), StartsWith("\x89PNG"));
}

TEST_F(ViewCommandTest, ShowsConfidenceErrorAndReport) {
  const std::string confidence =
      folder_.Write("c.txt", Gzip("# from match\n" + Numbers(42, "0.5")));
  const std::string report =
      folder_.Write("r.json", Gzip(R"({"total_seconds": 1.25})"));
  const CommandOutcome outcome =
      View({"-o", page_, "--png", png_, "--confidence", confidence, "--truth",
            map_, "--report", report, "--title", "A & B", "--layer", "error",
            "--up", "z"});
  ASSERT_EQ(outcome.status, kExitSuccess) << outcome.err;
  EXPECT_EQ(outcome.out, png_ + ": error, scale from 0 to 0.01\n");
  const std::string page = ReadFile(page_, "a page").value();
  for (const char* part :
       {"<title>A &amp; B</title>", R"("id":"confidence")", R"("id":"error")",
        R"("id":"distortion")", R"(["total time","1.25 s"])",
        R"(["mean / diameter of Y","0.00000"])", R"("layer":"error")"}) {
    EXPECT_THAT(page, HasSubstr(part));
  }
}

TEST_F(ViewCommandTest, WhatHasNoCounterpartIsTold) {
  std::string map = "-1\n-1\n";
  std::string mask = "0\n0\n0\n";
  for (int i = 2; i < 42; ++i) map += std::to_string(i) + "\n";
  mask += Numbers(39, "1");
  map_ = folder_.Write("map.txt", map);
  const std::string mask_y = folder_.Write("mask.txt", mask);
  EXPECT_EQ(View({"--png", png_}).out,
            png_ + ": gray, no counterpart: 2 vertices of X, 0 of Y\n");
  EXPECT_EQ(View({"--png", png_, "--mask-y", mask_y}).out,
            png_ + ": gray, no counterpart: 2 vertices of X, 3 of Y\n");
  const CommandOutcome outcome =
      View({"-o", page_, "--mask-y", mask_y, "--truth", map_, "--json"});
  ASSERT_EQ(outcome.status, kExitSuccess) << outcome.err;
  const auto figures = nlohmann::json::parse(outcome.out)["figures"];
  EXPECT_EQ(figures["Map"]["vertices of Y with a counterpart"], "39 of 42");
  EXPECT_EQ(
      figures["Error against the truth"]["IoU of the overlap, by area of X"],
      "1.00000");
  EXPECT_THAT(ReadFile(page_, "a page").value(),
              HasSubstr(R"("matched_y":"AAAAAQ)"));
  ExpectUsageError({"-o", page_, "--mask-y", map_}, "line 1: found '-1'");
  ExpectUsageError({"-o", page_, "--mask-y", folder_.Write("mask.txt", "1\n")},
                   "1 lines, expected 42, one for each vertex of Y");
}

TEST_F(ViewCommandTest, APreciseMapIsShownAndMeasuredWhereItIs) {
  const TriangleMesh mesh = BumpySphere(1);
  std::string places;
  std::string truth;
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    places += "0 0.5 0.5 0\n";
    truth += std::to_string(mesh.faces(0, 0)) + "\n";
  }
  map_ = folder_.Write("places.txt", places);
  const std::string gt = folder_.Write("gt.txt", truth);
  const CommandOutcome outcome =
      View({"-o", page_, "--png", png_, "--truth", gt, "--json"});
  ASSERT_EQ(outcome.status, kExitSuccess) << outcome.err;
  const auto json = nlohmann::json::parse(outcome.out);
  const CommandOutcome evaluated =
      RunIsomatch({"evaluate", y_, map_, gt, "--json"});
  ASSERT_EQ(evaluated.status, kExitSuccess) << evaluated.err;
  const auto errors = nlohmann::json::parse(evaluated.out);
  EXPECT_TRUE(errors["precise"].get<bool>());
  // Half an edge, not none or the whole.
  const double edge = (mesh.positions.row(mesh.faces(0, 0)) -
                       mesh.positions.row(mesh.faces(0, 1)))
                          .norm();
  EXPECT_NEAR(errors["direct"]["mean_over_diameter"].get<double>() *
                  errors["diameter"].get<double>(),
              edge / 2, 1e-6);
  EXPECT_EQ(json["figures"]["Error against the truth"]["mean / diameter of Y"],
            absl::StrFormat(
                "%.5f", errors["direct"]["mean_over_diameter"].get<double>()));
  EXPECT_THAT(ReadFile(page_, "a page").value(),
              HasSubstr(R"("precise":{"corners":")"));
}

TEST_F(ViewCommandTest, EvaluateSaysWhichLineOfAPreciseFileIsWrong) {
  const CommandOutcome outcome = RunIsomatch(
      {"evaluate", y_, folder_.Write("p.txt", "0 1 0 0\n99999 1 0 0\n"), map_});
  EXPECT_EQ(outcome.status, kExitUsage);
  EXPECT_THAT(outcome.err, HasSubstr("line 2: FACE is 99999"));
}

TEST_F(ViewCommandTest, TellsWhatItWroteAsJson) {
  const CommandOutcome outcome =
      View({"-o", page_, "--truth", map_, "--layer", "error", "--json"});
  ASSERT_EQ(outcome.status, kExitSuccess) << outcome.err;
  const auto json = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(json["page"], page_);
  EXPECT_TRUE(json["picture"].is_null());
  EXPECT_EQ(json["layer"], "error");
  ASSERT_EQ(json["layers"].size(), 2);
  EXPECT_EQ(json["layers"][0]["id"], "distortion");
  EXPECT_EQ(json["layers"][1]["id"], "error");
  EXPECT_EQ(json["layers"][1]["low"], 0);
  bool has_mean = false;
  for (const auto& table : json["figures"]) {
    has_mean = has_mean || table.value("mean / diameter of Y", "") == "0.00000";
  }
  EXPECT_TRUE(has_mean) << outcome.out;
  EXPECT_TRUE(json["warnings"].empty());
}

/// A mesh of three colored vertices.
std::string ColoredTriangle(const std::string& color) {
  std::string lines = "COFF\n3 1 0\n";
  for (const char* place : {"0 0 0 ", "1 0 0 ", "0 1 0 "}) {
    lines += place + color + "\n";
  }
  return lines + "3 0 1 2\n";
}

TEST_F(ViewCommandTest, ShowsTheColorsOfTheFiles) {
  const std::string map = folder_.Write("three.txt", "0\n1\n2\n");
  const std::string blue =
      folder_.Write("blue.off", ColoredTriangle("0 0 255 255"));
  std::vector<std::string> pictures;
  for (const char* color : {"255 0 0 255", "0 255 0 255"}) {
    const std::string x = folder_.Write("x.off", ColoredTriangle(color));
    for (const bool own : {false, true}) {
      std::vector<std::string> arguments = {"view", x,       blue,
                                            map,    "--png", png_};
      if (own) arguments.emplace_back("--file-colors");
      const CommandOutcome outcome = RunIsomatch(arguments);
      ASSERT_EQ(outcome.status, kExitSuccess) << outcome.err;
      pictures.push_back(ReadFile(png_, "a picture").value());
    }
  }
  EXPECT_EQ(pictures[0], pictures[2]);
  EXPECT_NE(pictures[1], pictures[0]);
  EXPECT_NE(pictures[1], pictures[3]);
}

TEST_F(ViewCommandTest, WrongUsageNamesTheOption) {
  ExpectUsageError({"--png", png_, "--file-colors"},
                   "X: '" + x_ + "' has no vertex colors");
  ExpectUsageError({"--png", png_, "-o", page_, "--file-colors"},
                   "--file-colors: is for --png alone");

  ExpectUsageError({"-o", page_, "--separate-pages"},
                   "--separate-pages: is for a folder");
  ExpectUsageError({"--file-colors"}, "--file-colors: is for --png alone");
  const std::string both = folder_.Path("both");
  ExpectUsageError({"-o", both, "--png", both}, "is the file of --output");
  ExpectUsageError({"-o", folder_.Path("no/page.html")}, "there is no folder");
  ExpectUsageError({"-o", page_, "--layer", "color"}, "--layer");
  ExpectUsageError({"-o", page_, "--layer", "error"}, "needs --truth FILE");
  ExpectUsageError({"-o", page_, "--layer", "confidence"},
                   "needs --confidence FILE");
  ExpectUsageError({"-o", page_, "--pattern", "dots"}, "--pattern");
  ExpectUsageError({"-o", page_, "--up", "w"}, "--up");
  for (const char* size : {"100", "63x100", "100x8193", "axb", "100x100x100"}) {
    ExpectUsageError({"--png", png_, "--size", size}, "--size is '");
  }
}

TEST_F(ViewCommandTest, WrongInputNamesFileAndLine) {
  ExpectUsageError({"-o", page_, "--confidence", folder_.Path("none")},
                   "no such file, expected confidence");
  const auto with_file = [&](const std::string& option, const std::string& text,
                             const std::string& why) {
    const std::string path = folder_.Write("input", text);
    ExpectUsageError({"-o", page_, option, path}, "'" + path + "'");
    ExpectUsageError({"-o", page_, option, path}, why);
  };
  with_file("--confidence", Numbers(41, "1"), "41 numbers, expected 42");
  with_file("--confidence", "1\n0.5 0.5\n", "line 2: found '0.5 0.5'");
  for (const char* bad : {"1.01", "-0.1", "nan", "x"}) {
    with_file("--confidence", bad, "expected one number from 0 to 1");
  }
  with_file("--truth", "0 42\n", "line 1: y is 42, expected -1 to 41");
  with_file("--report", "[]", "expected an object");
  map_ = folder_.Write("short.txt", Numbers(41, "0"));
  ExpectUsageError({"-o", page_}, "41 entries, expected 42");
  map_ = folder_.Write("far.txt", Numbers(42, "42"));
  ExpectUsageError({"-o", page_}, "line 1: y is 42, expected -1 to 41");
  map_ = folder_.Path("none.txt");
  ExpectUsageError({"-o", page_}, "no such file");
}

TEST_F(ViewCommandTest, AMapMayLeaveAllOut) {
  map_ = folder_.Write("none.txt", Numbers(42, "-1"));
  const CommandOutcome outcome =
      View({"-o", page_, "--png", png_, "--layer", "distortion"});
  EXPECT_EQ(outcome.status, kExitSuccess) << outcome.err;
}

}  // namespace
}  // namespace isomatch
