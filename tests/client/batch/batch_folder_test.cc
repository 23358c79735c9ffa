#include "client/batch/batch_folder.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/matchers.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Pair;

class BatchFolderTest : public testing::Test {
 protected:
  std::vector<BatchFolderPair> Read() {
    const auto pairs = ReadBatchFolder(folder_.Path(""));
    EXPECT_THAT(pairs, IsOk());
    return pairs.value_or(std::vector<BatchFolderPair>());
  }

  TemporaryFolder folder_;
};

TEST_F(BatchFolderTest, ReadsFilesAndFiguresOfEachPair) {
  folder_.Write("a__b.txt", "0\n");
  folder_.Write("a__b.precise.txt", "0 1 0 0\n");
  folder_.Write("a__b.json", R"({
      "mesh_x": {"vertices": 7}, "quality": {"mean_confidence": 0.5},
      "verdict": {"level": "doubtful", "reason": "why"},
      "batch": {"x": "../x/a.off", "y": "/y/b.off",
                "error": {"direct": 0.25}}})");
  folder_.Write("other.json", "{}");
  folder_.Write("a__notes.txt", "no pair");
  const std::vector<BatchFolderPair> pairs = Read();
  ASSERT_EQ(pairs.size(), 1);
  const BatchFolderPair& pair = pairs[0];
  EXPECT_EQ(pair.name, "a__b");
  EXPECT_THAT(pair.x, EndsWith("/x/a.off"));
  EXPECT_THAT(pair.x, testing::Not(HasSubstr("..")));
  EXPECT_EQ(pair.y, "/y/b.off");
  EXPECT_THAT(pair.map, EndsWith("a__b.txt"));
  EXPECT_THAT(pair.precise, EndsWith("a__b.precise.txt"));
  EXPECT_EQ(pair.confidence, "");
  EXPECT_EQ(pair.verdict, "doubtful");
  EXPECT_EQ(pair.reason, "why");
  EXPECT_THAT(pair.figures,
              ElementsAre(Pair("confidence", 0.5), Pair("direct", 0.25),
                          Pair("vertices_x", 7)));
  EXPECT_EQ(pair.failure, "");
}

TEST_F(BatchFolderTest, SaysWhyAReportIsNotRead) {
  folder_.Write("a__b.json",
                "{\"mesh_x\": 5, \"quality\": [], \"verdict\": 1}");
  folder_.Write("a__c.json", "[1]");
  folder_.Write("a__d.json", "{\"batch\"");
  folder_.Write("a__e.json", R"({"batch": {"x": 1, "y": "b"}})");
  const std::vector<BatchFolderPair> pairs = Read();
  ASSERT_EQ(pairs.size(), 4);
  EXPECT_THAT(pairs[0].failure, HasSubstr("batch.x and batch.y"));
  EXPECT_THAT(pairs[0].figures, IsEmpty());
  EXPECT_THAT(pairs[1].failure, HasSubstr("a__c.json': not JSON"));
  EXPECT_THAT(pairs[2].failure, HasSubstr("a__d.json': not JSON"));
  EXPECT_THAT(pairs[3].failure, HasSubstr("batch.x and batch.y"));
}

TEST_F(BatchFolderTest, TellsOfPairsThatFailed) {
  folder_.Write("a__b.json", R"({"batch": {"x": "a", "y": "b"}})");
  folder_.Write("summary.csv",
                "x,y,state,message\r\n"
                "a,b,done,\n"
                "\"p,q\",r,failed,\"it \"\"said\"\"\nno\"\n"
                "a,z,waiting,\n"
                "short\n");
  const std::vector<BatchFolderPair> pairs = Read();
  ASSERT_EQ(pairs.size(), 3);
  EXPECT_EQ(pairs[0].failure, "");
  EXPECT_EQ(pairs[1].name, "a__z");
  EXPECT_EQ(pairs[1].failure, "waiting");
  EXPECT_EQ(pairs[2].name, "p,q__r");
  EXPECT_EQ(pairs[2].failure, "it \"said\"\nno");
}

TEST_F(BatchFolderTest, AFolderOfOtherThingsIsRefused) {
  folder_.Write("summary.csv", "x,y\n");
  EXPECT_THAT(ReadBatchFolder(folder_.Path("")),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("has no X__Y.json")));
  EXPECT_THAT(ReadBatchFolder(folder_.Path("none")),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("cannot be read")));
}

}  // namespace
}  // namespace isomatch
