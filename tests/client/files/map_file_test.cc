#include "client/files/map_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/files/text_file.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class MapFileTest : public testing::Test {
 protected:
  auto Refused(const std::string& why) {
    return StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(why));
  }
  absl::StatusOr<GroundTruth> Truth(const std::string& text) {
    return ReadGroundTruth(folder_.Write("gt", text), 3, 5);
  }
  absl::Status Landmarks(const std::string& text) {
    return ReadLandmarks(folder_.Write("lm", text), 3, 5).status();
  }
  TemporaryFolder folder_;
};

TEST_F(MapFileTest, MapComesBack) {
  const VertexMap map = {4, kNoVertex, 0};
  ASSERT_THAT(WriteFileAtomically(folder_.Path("map"), FormatMap(map)), IsOk());
  EXPECT_EQ(*ReadMap(folder_.Path("map"), 5), map);
  EXPECT_EQ(folder_.CountFiles(), 1);
}

TEST_F(MapFileTest, WrongMapsNameTheLine) {
  EXPECT_THAT(ReadMap(folder_.Write("map", "1\n5\n"), 5),
              Refused("line 2: y is 5, expected -1 to 4"));
  EXPECT_THAT(ReadMap(folder_.Write("map", "1\n2 3\n"), 5),
              Refused("line 2: found 2 numbers"));
  EXPECT_THAT(ReadMap(folder_.Write("map", "1\n2.5\n"), 5),
              Refused("line 2: found '2.5', expected a whole number"));
  EXPECT_THAT(ReadMap(folder_.Write("map", ""), 5), Refused("empty"));
  EXPECT_THAT(ReadMap(folder_.Path("none"), 5),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("no such file")));
}

TEST_F(MapFileTest, TheExtensionTellsTheFormat) {
  const VertexMap map = {4, kNoVertex, 0};
  for (const char* name : {"map.txt", "map.npy", "map.NPY", "map.json"}) {
    const std::string path = folder_.Write(
        name, FormatMap(map, /*vertices_y=*/5, MapFormatOf(name)));
    const absl::StatusOr<VertexMap> read = ReadMap(path, 5, 3);
    ASSERT_THAT(read, IsOk()) << name;
    EXPECT_EQ(*read, map) << name;
  }
  EXPECT_EQ(FormatMap(map, 5, MapFormat::kText), "4\n-1\n0\n");
  EXPECT_EQ(FormatMap(map, 5, MapFormat::kJson),
            "{\"format\":\"isomatch-map\",\"version\":1,\"vertices_x\":3,"
            "\"vertices_y\":5,\"y_from_x\":[4,-1,0]}\n");
}

TEST_F(MapFileTest, JsonThatIsNoMapIsRefused) {
  const auto read = [&](const std::string& version, const std::string& y) {
    return ReadMap(
        folder_.Write("m.json",
                      "{\"format\":\"isomatch-map\",\"version\":" + version +
                          ",\"vertices_x\":1,\"vertices_y\":5,"
                          "\"y_from_x\":[" +
                          y + "]}"),
        5);
  };
  ASSERT_THAT(read("1", "4"), IsOk());
  EXPECT_THAT(read("2", "4"), Refused("version is 2, expected 1"));
  EXPECT_THAT(read("1e999", "4"), Refused("not JSON"));
  EXPECT_THAT(read("1", "18446744073709551615"),
              Refused("y_from_x[0] is 18446744073709551615"));
  // Deeper than the stack is.
  constexpr std::size_t kDepth = 200'000;
  const std::string deep = std::string(kDepth, '[') + std::string(kDepth, ']');
  EXPECT_THAT(read(deep, "4"), Refused("the JSON is deeper than 8"));
  EXPECT_THAT(read("1", deep), Refused("the JSON is deeper than 8"));
  // Each object took as long as all before it.
  std::string objects = "{}";
  for (int i = 0; i < 300'000; ++i) objects += ",{}";
  EXPECT_THAT(read("1", objects), Refused("has more objects than 1000"));
}

TEST_F(MapFileTest, AMapForOtherMeshesIsRefused) {
  const VertexMap map = {4, kNoVertex, 0};
  for (const char* name : {"map.txt", "map.npy", "map.json"}) {
    const std::string path =
        folder_.Write(name, FormatMap(map, 5, MapFormatOf(name)));
    EXPECT_THAT(ReadMap(path, 5, 4), Refused("3 entries, expected 4")) << name;
  }
  EXPECT_THAT(ReadMap(folder_.Path("map.npy"), 4),
              Refused("entry 0 (0-based): y is 4, expected -1 to 3"));
  EXPECT_THAT(ReadMap(folder_.Path("map.json"), 6),
              Refused("vertices_y is 5, expected 6"));
}

TEST_F(MapFileTest, WrongJsonSaysWhatWasExpected) {
  const auto read = [&](const std::string& text) {
    return ReadMap(folder_.Write("map.json", text), 5);
  };
  EXPECT_THAT(read("{\"format\": "), Refused("not JSON"));
  EXPECT_THAT(read("{\"format\": "), Refused("byte 12"));
  EXPECT_THAT(read("[1, 2]"), Refused("format \"isomatch-map\""));
  EXPECT_THAT(read("{\"format\":\"isomatch-map\",\"version\":2}"),
              Refused("version is 2, expected 1"));
  EXPECT_THAT(
      read("{\"format\":\"isomatch-map\",\"version\":1,\"vertices_y\":5}"),
      Refused("y_from_x is no array"));
  const std::string head =
      "{\"format\":\"isomatch-map\",\"version\":1,\"vertices_x\":2,"
      "\"vertices_y\":5,\"y_from_x\":";
  EXPECT_THAT(read(head + "[1]}"), Refused("vertices_x is 2, expected 1"));
  EXPECT_THAT(read(head + "[1,2.5]}"),
              Refused("y_from_x[1] is 2.5, expected a whole number"));
  EXPECT_THAT(read(head + "[1,5]}"), Refused("entry 1 (0-based): y is 5"));
}

TEST_F(MapFileTest, APictureIsNoMap) {
  EXPECT_THAT(ReadMap(folder_.Write("map.ply", "ply\n"), 5),
              Refused("for looking at only, expected one in a .txt, .npy"));
}

TEST_F(MapFileTest, ATruthMayBeAMapOfAnyFormat) {
  const std::string path = folder_.Write(
      "gt.npy", FormatMap(VertexMap{1, kNoVertex, 4}, 5, MapFormat::kNpy));
  EXPECT_THAT(ReadGroundTruth(path, 3, 5)->direct, ElementsAre(1, -1, 4));
  EXPECT_THAT(ReadGroundTruth(path, 4, 5), Refused("3 entries, expected 4"));
}

TEST_F(MapFileTest, LabelsComeBackInBothFormats) {
  const std::vector<std::int64_t> labels = {7, -3, 1'000'000'000'000};
  for (const char* name : {"labels.txt", "labels.npy"}) {
    const std::string path = folder_.Write(name, FormatLabels(name, labels));
    EXPECT_EQ(*ReadLabels(path, 3), labels) << name;
    EXPECT_THAT(ReadLabels(path, 4), Refused("3 entries, expected 4"));
  }
  EXPECT_THAT(ReadLabels(folder_.Write("labels.txt", "1\n2 3\n"), 2),
              Refused("line 2: found 2 numbers, expected 1 (label)"));
}

TEST_F(MapFileTest, LandmarksMayHaveCommentsAndBlankLines) {
  const auto landmarks = ReadLandmarks(
      folder_.Write("lm", "# nose\n\n0 4  # tip\n 2,1\r\n"), 3, 5);
  ASSERT_THAT(landmarks, IsOk());
  ASSERT_EQ(landmarks->size(), 2u);
  EXPECT_EQ((*landmarks)[1].x, 2);
  EXPECT_EQ((*landmarks)[1].y, 1);
}

TEST_F(MapFileTest, WrongLandmarksNameTheLine) {
  EXPECT_THAT(Landmarks("0 1\n3 1\n"), Refused("line 2: x is 3"));
  EXPECT_THAT(Landmarks("0 5\n"), Refused("line 1: y is 5"));
  EXPECT_THAT(Landmarks("0\n"), Refused("line 1: found 1 numbers"));
  EXPECT_THAT(Landmarks("0 1\n0 2\n"), Refused("line 2: vertex 0 of X"));
  EXPECT_THAT(Landmarks("0 1\n2 1\n"), Refused("line 2: vertex 1 of Y"));
  EXPECT_THAT(Landmarks("# none\n"), Refused("no line of numbers"));
}

TEST_F(MapFileTest, TruthHasThreeForms) {
  EXPECT_THAT(Truth("1\n-1\n4\n")->direct, ElementsAre(1, -1, 4));
  EXPECT_THAT(Truth("2 3\n0 1\n")->direct, ElementsAre(1, -1, 3));
  const absl::StatusOr<GroundTruth> mirrored = Truth("0 1 2\n2 3 4\n");
  ASSERT_THAT(mirrored, IsOk());
  EXPECT_THAT(mirrored->direct, ElementsAre(1, -1, 3));
  EXPECT_THAT(mirrored->mirrored, ElementsAre(2, -1, 4));
}

TEST_F(MapFileTest, ATruthKeepsNoCounterpartApartFromNotNamed) {
  const absl::StatusOr<GroundTruth> truth = Truth("2 3\n0 -1\n");
  ASSERT_THAT(truth, IsOk());
  EXPECT_THAT(truth->direct, ElementsAre(-1, -1, 3));
  EXPECT_THAT(truth->named, ElementsAre(true, false, true));
  EXPECT_THAT(Truth("1\n-1\n4\n")->named, IsEmpty());
  EXPECT_THAT(Truth("0 -2\n"), Refused("line 1: y is -2, expected -1 to 4"));
}

TEST_F(MapFileTest, WrongTruthSaysWhatWasExpected) {
  EXPECT_THAT(Truth("1\n2\n"), Refused("expected 3, one for each vertex of X"));
  EXPECT_THAT(Truth("0 1 2 3\n"), Refused("found 4 numbers"));
  EXPECT_THAT(Truth("0 1\n1 2 3\n"), Refused("line 2: found 3 numbers"));
}

TEST_F(MapFileTest, OutputNeedsItsFolder) {
  EXPECT_THAT(WriteFileAtomically(folder_.Path("no/map"), "1\n"),
              Refused("there is no folder"));
  EXPECT_THAT(WriteFileAtomically(folder_.Path(""), "1\n"),
              Refused("a directory"));
}

}  // namespace
}  // namespace isomatch
