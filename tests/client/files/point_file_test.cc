#include "client/files/point_file.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/matchers.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::HasSubstr;

class PointFileTest : public testing::Test {
 protected:
  absl::StatusOr<PointFile> Read(const std::string& name,
                                 const std::string& text) {
    return ReadPoints(folder_.Write(name, text));
  }
  void ExpectRefused(const std::string& name, const std::string& text,
                     const std::string& why) {
    EXPECT_THAT(Read(name, text),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(why)))
        << text;
  }
  // Two points, nose and tail.
  void ExpectTwo(const std::string& name, const std::string& text,
                 const std::string& space) {
    const auto file = Read(name, text);
    ASSERT_THAT(file, IsOk()) << text;
    ASSERT_EQ(file->points.size(), 2u) << text;
    EXPECT_EQ(file->points[0].position, Eigen::RowVector3d(1, -2.5, 3));
    EXPECT_EQ(file->points[0].label, "nose") << text;
    EXPECT_EQ(file->points[1].position, Eigen::RowVector3d(4, 5, 6e-3));
    EXPECT_EQ(file->points[1].label, "tail") << text;
    EXPECT_EQ(file->space, space) << text;
  }
  TemporaryFolder folder_;
};

TEST_F(PointFileTest, EveryFormatHasPositionsAndLabels) {
  ExpectTwo("a.txt", "# by hand\n1 -2.5 3 nose\n4\t5 6e-3 tail\n", "");
  ExpectTwo("a.csv", "1,-2.5,3,nose\n4,5,0.006,tail\n", "");
  ExpectTwo("a.csv", "Label, Z, Y, X\n\"nose\",3,-2.5,1\ntail,0.006,5,4\n", "");
  ExpectTwo("a.fcsv",
            "# Markups fiducial file version = 4.10\n# CoordinateSystem = 0\n"
            "# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,"
            "associatedNodeID\n"
            "vtkMRML_0,1,-2.5,3,0,0,0,1,1,1,0,nose,,vtkM\n"
            "vtkMRML_1,4,5,0.006,0,0,0,1,1,1,0,tail,,\n",
            "RAS");
  ExpectTwo("a.mrk.json", R"({"@schema": "s", "markups": [{
      "type": "Fiducial", "coordinateSystem": "LPS", "controlPoints": [
      {"id": "1", "label": "nose", "position": [1, -2.5, 3.0],
       "orientation": [-1, 0, 0, 0, -1, 0, 0, 0, 1],
       "positionStatus": "defined"},
      {"id": "2", "label": "tail", "position": [4, 5, 6e-3]}]}]})",
            "LPS");
}

// Labels that were cut would all be one, and points be paired by order.
TEST_F(PointFileTest, LabelsOfTablesMayHaveAnySign) {
  const std::string head = "# Markups fiducial file version = 4.11\n";
  for (const auto& [name, text] :
       {std::pair("a.fcsv",
                  head + "1,1,2,3,0,0,0,1,1,1,0,\"F #1, \"\"l\"\"\",,\n"),
        std::pair("a.csv",
                  std::string("x,y,z,name\n1,2,3,\"F #1, \"\"l\"\"\"")),
        std::pair("b.csv",
                  std::string("label,x,y,z\n# no point\n"
                              "\"F #1, \"\"l\"\"\",1,2,3 # here\n"))}) {
    const auto file = Read(name, text);
    ASSERT_THAT(file, IsOk()) << text;
    ASSERT_EQ(file->points.size(), 1u) << text;
    EXPECT_EQ(file->points[0].label, "F #1, \"l\"") << text;
    EXPECT_EQ(file->points[0].position, Eigen::RowVector3d(1, 2, 3)) << text;
  }
  const auto lines = Read("a.txt", "1 2 3 nose # its tip, not the bridge\n");
  ASSERT_THAT(lines, IsOk());
  EXPECT_EQ(lines->points[0].label, "nose");
}

TEST_F(PointFileTest, AByteOrderMarkIsNoPartOfANumber) {
  ExpectTwo("a.csv",
            "\xEF\xBB\xBFx,y,z,label\r\n1,-2.5,3,nose\r\n4,5,6e-3,tail\r\n",
            "");
}

TEST_F(PointFileTest, PointsThatNobodyPlacedAreCounted) {
  const auto file = Read("a.mrk.json", R"({"markups": [{"controlPoints": [
      {"label": "a", "position": [1, 2, 3]},
      {"label": "b", "position": [0, 0, 0], "positionStatus": "undefined"},
      {"label": "c"}]}]})");
  ASSERT_THAT(file, IsOk());
  EXPECT_EQ(file->points.size(), 1u);
  EXPECT_EQ(file->without_position, 2);
  EXPECT_EQ(file->space, "LPS");  // Slicer's default
}

TEST_F(PointFileTest, WrittenPointsComeBack) {
  const std::vector<LandmarkPoint> points = {{{1, -2.5, 3}, "nose"},
                                             {{4, 5, 6e-3}, "tail"}};
  for (const char* const name : {"b.mrk.json", "b.fcsv"}) {
    ExpectTwo(name, FormatPoints(name, "RAS", points), "RAS");
    ExpectTwo(name, FormatPoints(name, "", points), "LPS");
  }
  ExpectTwo("b.csv", FormatPoints("b.csv", "", points), "");
  EXPECT_TRUE(IsPointFile("a.mrk.json") && IsPointFile("a.FCSV.gz"));
  EXPECT_FALSE(IsPointFile("a.txt") || IsPointFile("a"));
  const std::string sharp = FormatPoints("b.fcsv", "", {{{1, 2, 3}, "F #1"}});
  EXPECT_EQ(Read("b.fcsv", sharp)->points[0].label, "F #1");
}

TEST_F(PointFileTest, WrongFilesSayWhere) {
  ExpectRefused("a.txt", "1 2 3\n1 q 3\n",
                "a.txt', line 2: y is 'q', expected a finite number");
  ExpectRefused("a.txt", "1 2\n", "line 1: z is missing");
  ExpectRefused("a.csv", "1,2,nan\n", "z is 'nan'");
  ExpectRefused("a.txt", "# none\n", "no points, expected");
  ExpectRefused("a.fcsv", "# CoordinateSystem = IJK\n1,1,2,3\n",
                "the coordinate system is 'IJK', expected LPS or RAS");
  ExpectRefused("a.fcsv", "# columns = id,a,b\n1,1,2,3\n", "its columns are");
  ExpectRefused("a.mrk.json", "{\"markups\": [}", "byte 14: not JSON");
  ExpectRefused("a.mrk.json", "{}", "there is no array markups");
  ExpectRefused("a.mrk.json", "{\"markups\": [{}]}", "no array controlPoints");
  ExpectRefused("a.mrk.json",
                "{\"markups\": [{\"controlPoints\": "
                "[{\"position\": [1, 2]}]}]}",
                "control point 0 (0-based): expected a position of three");
  ExpectRefused("a.mrk.json",
                "{\"markups\": [{\"coordinateSystem\": 7, "
                "\"controlPoints\": []}]}",
                "the coordinate system is '7'");
  ExpectRefused("a.json", std::string(100'000, '['),
                "the JSON is deeper than 64");
}

}  // namespace
}  // namespace isomatch
