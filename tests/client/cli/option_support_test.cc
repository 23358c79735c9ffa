#include "client/cli/option_support.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace isomatch {
namespace {

using testing::HasSubstr;
using testing::Optional;

TEST(DidYouMeanTest, FindsWhatWasProbablyMeant) {
  const std::vector<std::string> commands = {"match", "batch",   "man",
                                             "view",  "inspect", "completion"};
  EXPECT_THAT(DidYouMean("mtach", commands), Optional<std::string>("match"));
  EXPECT_THAT(DidYouMean("mach", commands), Optional<std::string>("match"));
  EXPECT_THAT(DidYouMean("mattch", commands), Optional<std::string>("match"));
  EXPECT_THAT(DidYouMean("bacth", commands), Optional<std::string>("batch"));
  EXPECT_THAT(DidYouMean("compl", commands),
              Optional<std::string>("completion"));
  EXPECT_EQ(DidYouMean("register", commands), std::nullopt);
  EXPECT_EQ(DidYouMean("x", {"on", "y"}), std::nullopt);
  EXPECT_EQ(DidYouMean("", commands), std::nullopt);
}

TEST(WholeNumberTest, TakesDigitsInTheRangeOnly) {
  const CLI::Validator check = WholeNumber(1, 64);
  for (std::string good : {"1", "64", "007"}) EXPECT_EQ(check(good), "");
  for (std::string bad :
       {"0", "65", "-1", "+1", "1.0", "", " 1", "99999999999999999999"}) {
    EXPECT_THAT(check(bad), HasSubstr("expected a whole number from 1 to 64"));
  }
}

TEST(MemorySizeTest, MakesBytes) {
  const CLI::Validator size = MemorySize();
  for (const auto& [text, bytes] :
       {std::pair("5MB", "5000000"), std::pair("2gib", "2147483648"),
        std::pair("100", "100")}) {
    std::string value = text;
    EXPECT_EQ(size(value), "");
    EXPECT_EQ(value, bytes);
  }
  for (std::string bad : {"-1MB", "MB", "", "5 apples", "99999999999999TB"}) {
    EXPECT_THAT(size(bad), HasSubstr("expected a number of bytes"));
  }
}

TEST(OptionTest, ChoicesAndPlaceholdersAreReadBack) {
  CLI::App app;
  std::string value;
  const CLI::Option* const choice =
      SetChoices(app.add_option("--profile", value), "NAME", {"a", "b"});
  const CLI::Option* const file =
      app.add_option("--file", value)->type_name(kFile);
  EXPECT_EQ(ChoicesOf(*choice), (std::vector<std::string>{"a", "b"}));
  EXPECT_EQ(PlaceholderOf(*choice), "NAME");
  EXPECT_TRUE(ChoicesOf(*file).empty());
  EXPECT_EQ(PlaceholderOf(*file), kFile);
}

}  // namespace
}  // namespace isomatch
