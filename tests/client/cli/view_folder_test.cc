#include "client/cli/view_folder.h"

#include <cstdint>
#include <filesystem>
#include <stop_token>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "client/files/mesh_file.h"
#include "client/files/text_file.h"
#include "tests/client/cli/run_isomatch.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

/// Three pairs of spheres, as a batch leaves them.
class ViewFolderTest : public testing::Test {
 protected:
  ViewFolderTest() {
    EXPECT_THAT(WriteMesh(folder_.Path("s.off"), BumpySphere(1)), IsOk());
    std::filesystem::create_directory(maps_);
    std::string map;
    for (int i = 0; i < 42; ++i) absl::StrAppend(&map, i, "\n");
    for (const char* name : {"a__b", "a__c", "a__d"}) {
      folder_.Write(absl::StrCat("maps/", name, ".txt"), map);
      folder_.Write(absl::StrCat("maps/", name, ".json"),
                    R"({"batch": {"x": "../s.off", "y": "../s.off"}})");
    }
  }

  CommandOutcome View(std::vector<std::string> options) {
    std::vector<std::string> arguments = {"view", maps_};
    arguments.insert(arguments.end(), options.begin(), options.end());
    return RunIsomatch(arguments);
  }

  void ExpectUsageError(const std::vector<std::string>& options,
                        const std::string& why) {
    const CommandOutcome outcome = View(options);
    EXPECT_EQ(outcome.status, kExitUsage) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(why));
    EXPECT_FALSE(std::filesystem::exists(page_));
  }

  TemporaryFolder folder_;
  const std::string maps_ = folder_.Path("maps");
  const std::string page_ = folder_.Path("page.html");
};

/// The JSON of the element with this id.
json Element(const std::string& page, const std::string& id) {
  const std::string begin = absl::StrCat("id=\"", id, "\">");
  const std::size_t at = page.find(begin);
  EXPECT_NE(at, std::string::npos) << id;
  const std::size_t from = at + begin.size();
  return json::parse(page.substr(from, page.find("</script>", from) - from));
}

TEST_F(ViewFolderTest, OnePageHoldsAllPairs) {
  const CommandOutcome outcome = View({"-o", page_, "--json"});
  ASSERT_EQ(outcome.status, kExitSuccess) << outcome.err;
  EXPECT_EQ(json::parse(outcome.out), json({{"page", page_},
                                            {"pages", nullptr},
                                            {"pairs", 3},
                                            {"failures", json::array()}}));
  const std::string page = ReadFile(page_, "a page").value();
  EXPECT_THAT(page, HasSubstr("<title>maps</title>"));
  const json list = Element(page, "pairs");
  ASSERT_EQ(list["pairs"].size(), 3);
  EXPECT_EQ(list["pairs"][1]["name"], "a__c");
  EXPECT_EQ(list["pairs"][1]["here"], true);
  EXPECT_FALSE(list["pairs"][1]["png"].get<std::string>().empty());
  EXPECT_EQ(Element(page, "data-2")["x"]["vertices"], 42);
  // Its own title is not put into the pages of pairs.
  EXPECT_THAT(Element(page, "template").get<std::string>(),
              HasSubstr("<title><!--TITLE--></title>"));
  EXPECT_THAT(page, Not(HasSubstr(" src=")));
}

TEST_F(ViewFolderTest, PairsThatTakeTooMuchHavePagesOfTheirOwn) {
  // The second one is too much, so that the first one moves out as well.
  const Terminal terminal;
  const auto whole =
      WriteFolderPage({.folder = maps_, .page = page_}, terminal);
  ASSERT_THAT(whole, IsOk());
  const auto one = static_cast<std::int64_t>(
      Element(ReadFile(page_, "a page").value(), "data-0").dump().size());
  const auto outcome = WriteFolderPage(
      {.folder = maps_, .page = page_, .embedded_bytes = 3 * one / 2},
      terminal);
  ASSERT_THAT(outcome, IsOk());
  EXPECT_EQ(outcome->pages, folder_.Path("page_pairs"));
  const std::string page = ReadFile(page_, "a page").value();
  EXPECT_LT(page.size(), 100'000);
  const json list = Element(page, "pairs");
  for (const auto& pair : list["pairs"]) {
    EXPECT_EQ(pair["here"], false);
    const std::string path = pair["page"];
    EXPECT_EQ(path, absl::StrCat("page_pairs/", pair["name"].get<std::string>(),
                                 ".html"));
    EXPECT_EQ(Element(ReadFile(folder_.Path(path), "a page").value(),
                      "pair")["y"]["vertices"],
              42);
  }
}

TEST_F(ViewFolderTest, APairThatCannotBeShownIsListed) {
  folder_.Write("maps/a__c.json",
                R"({"batch": {"x": "no.off", "y": "no.off"}})");
  folder_.Write("maps/a__d.txt", "1\n");
  const CommandOutcome outcome = View({"-o", page_});
  ASSERT_EQ(outcome.status, kExitSuccess) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("a__c: X: '"));
  EXPECT_THAT(outcome.err, HasSubstr("no such file"));
  const json list = Element(ReadFile(page_, "a page").value(), "pairs");
  EXPECT_THAT(list["pairs"][1]["failure"].get<std::string>(),
              HasSubstr("no such file"));
  EXPECT_THAT(list["pairs"][2]["failure"].get<std::string>(),
              HasSubstr("1 entries, expected 42"));
  EXPECT_EQ(list["pairs"][2]["here"], false);
}

TEST_F(ViewFolderTest, WrongUsageNamesWhatIsWrong) {
  ExpectUsageError({"-o", page_, "--png", folder_.Path("a.png")},
                   "--png: is for one pair");
  ExpectUsageError({"-o", page_, "--truth", page_}, "--truth: is for one pair");
  ExpectUsageError({"-o", page_, "--mask-y", page_},
                   "--mask-y: is for one pair");
  ExpectUsageError({"-o", page_, "--layer", "error"},
                   "--layer error: is for one pair");
  ExpectUsageError({maps_, "-o", page_}, "MAP: is missing");
  const CommandOutcome file =
      RunIsomatch({"view", folder_.Path("s.off"), "-o", page_});
  EXPECT_THAT(file.err,
              HasSubstr("is no folder, expected X Y MAP or one FOLDER"));
  for (const char* name : {"a__b", "a__c", "a__d"}) {
    folder_.Write(absl::StrCat("maps/", name, ".txt"), "0\n");
  }
  ExpectUsageError({"-o", page_}, "none of 3 pairs can be shown; a__b: ");
}

TEST_F(ViewFolderTest, ALayerThatAPairLacksIsNotShownFirst) {
  std::string numbers;
  for (int i = 0; i < 42; ++i) numbers += "0.5\n";
  folder_.Write("maps/a__c.confidence.txt", numbers);
  ASSERT_EQ(View({"-o", page_, "--layer", "confidence"}).status, kExitSuccess);
  const std::string page = ReadFile(page_, "a page").value();
  EXPECT_EQ(Element(page, "data-0")["layer"], "colors");
  EXPECT_EQ(Element(page, "data-1")["layer"], "confidence");
}

TEST_F(ViewFolderTest, WhatHasNoCounterpartIsKnownOfPairsWithAMask) {
  std::string mask = "0\n";
  for (int i = 1; i < 42; ++i) mask += "1\n";
  folder_.Write("maps/a__c.mask_y.txt", mask);
  ASSERT_EQ(View({"-o", page_}).status, kExitSuccess);
  const std::string page = ReadFile(page_, "a page").value();
  EXPECT_TRUE(Element(page, "data-0")["matched_y"].is_null());
  EXPECT_FALSE(Element(page, "data-1")["matched_y"].is_null());
}

TEST_F(ViewFolderTest, StopsWhenAsked) {
  std::stop_source stop;
  stop.request_stop();
  const Terminal terminal{.stop = stop.get_token()};
  EXPECT_THAT(WriteFolderPage({.folder = maps_, .page = page_}, terminal),
              StatusIs(absl::StatusCode::kCancelled, HasSubstr("interrupted")));
  EXPECT_FALSE(std::filesystem::exists(page_));
}

}  // namespace
}  // namespace isomatch
