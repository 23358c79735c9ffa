#include "server/rpc/security/api_keys.h"

#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "core/base/sha256.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

constexpr auto kInvalid = absl::StatusCode::kInvalidArgument;

std::string Line(const std::string& words, const std::string& key) {
  return absl::StrCat(words, " ", Sha256Hex(key), "\n");
}

/// The same with a fifth word.
std::string LineWith(const std::string& words, const std::string& key,
                     const std::string& word) {
  return absl::StrCat(words, " ", Sha256Hex(key), " ", word, "\n");
}

TEST(ApiKeysTest, LinesAreReadAndTheirKeysFound) {
  const auto keys = ParseApiKeys(
      absl::StrCat("# of the lab\n\n", Line("alice lab read", "a"),
                   Line(" bob\tlab-2  submit ", "b"), "# end\r\n",
                   "root default admin ", Sha256Hex("c"), "  # the operator"));
  ASSERT_THAT(keys, IsOk());
  ASSERT_EQ(keys->size(), 3);
  EXPECT_EQ(FindApiKey(*keys, "a")->name, "alice");
  EXPECT_EQ(FindApiKey(*keys, "b")->name, "bob");
  EXPECT_EQ(FindApiKey(*keys, "b")->caller.tenant, "lab-2");
  EXPECT_EQ(FindApiKey(*keys, "b")->caller.role, Role::kSubmit);
  EXPECT_EQ(FindApiKey(*keys, "c")->caller.role, Role::kAdmin);
  EXPECT_EQ(FindApiKey(*keys, "d"), nullptr);
  EXPECT_EQ(FindApiKey(*keys, ""), nullptr);
  // The hash is no key: who can read the file cannot call.
  EXPECT_EQ(FindApiKey(*keys, Sha256Hex("a")), nullptr);
}

TEST(ApiKeysTest, WhatIsWrongIsToldByLineWithoutAnyOfItsWords) {
  const std::string good = Line("alice lab read", "a");
  const struct {
    std::string text;
    std::string problem;
  } kCases[] = {
      {"", "no key in it"},
      {"# only a comment\n", "no key in it"},
      {good + "bob secret", "line 2, expected name, tenant, role and SHA-256"},
      {good + "\n" + Line("bob lab secret", "b"), "line 3, expected a role"},
      {LineWith("alice lab read", "a", "50"),
       "line 1, expected max-priority=N"},
      {LineWith("alice lab read", "a", "max-priority=101"),
       "line 1, expected max-priority=N as the fifth word, N from 0 to 100"},
      {LineWith("alice lab read", "a", "max-priority=-1"), "N from 0 to 100"},
      {LineWith("alice lab read", "a", "max-priority=1 x"), "line 1, expected"},
      {good + "bob lab read secret", "line 2, expected as the fourth word"},
      {Line("Secret lab read", "a"), "line 1, expected a name and a tenant"},
      {Line("alice secret! read", "a"), "line 1, expected a name"},
      {good + Line("bob lab read", "a"), "line 2, expected a name and a key"},
      {good + Line("alice lab read", "b"), "line 2, expected a name and a key"},
  };
  for (const auto& [text, problem] : kCases) {
    EXPECT_THAT(
        ParseApiKeys(text),
        StatusIs(kInvalid, AllOf(HasSubstr(problem), Not(HasSubstr("ecret")))))
        << text;
  }
}

TEST(ApiKeysTest, AKeySaysHowFarItsPrioritiesCountOrTheServerDoes) {
  const auto keys =
      ParseApiKeys(LineWith("alice lab read", "a", "max-priority=70") +
                       Line("bob lab read", "b"),
                   /*max_priority=*/5);
  ASSERT_THAT(keys, IsOk());
  EXPECT_EQ(FindApiKey(*keys, "a")->caller.max_priority, 70);
  EXPECT_EQ(FindApiKey(*keys, "b")->caller.max_priority, 5);
}

TEST(ApiKeysTest, AFreshKeyIsFoundByItsLine) {
  const std::string random(32, '\x5a');
  const NewApiKey made = MakeApiKey("alice", {"lab", Role::kSubmit}, random);
  EXPECT_EQ(made.key.size(), 52);
  EXPECT_THAT(made.line, Not(HasSubstr(made.key)));
  const auto keys = ParseApiKeys(made.line);
  ASSERT_THAT(keys, IsOk());
  EXPECT_EQ(FindApiKey(*keys, made.key)->name, "alice");
  EXPECT_EQ(FindApiKey(*keys, made.key)->caller.tenant, "lab");
  EXPECT_EQ(FindApiKey(*keys, made.key)->caller.role, Role::kSubmit);
}

class ApiKeyFileTest : public testing::Test {
 protected:
  void Open() {
    auto opened = ApiKeys::Open(
        path_, [this] { return now_; },
        [this](const absl::Status& status) { reloads_.push_back(status); });
    ASSERT_THAT(opened, IsOk());
    keys_ = *std::move(opened);
  }

  void Write(const std::string& text) { folder_.Write("keys", text); }

  bool Knows(const std::string& key) { return keys_->Find(key).has_value(); }

  TemporaryFolder folder_;
  const std::string path_ = folder_.Path("keys");
  const std::string alice_ = Line("alice lab read", "a");
  const std::string bob_ = Line("bob lab read", "b");
  absl::Time now_ = absl::FromUnixSeconds(1000);
  std::vector<absl::Status> reloads_;
  std::unique_ptr<ApiKeys> keys_;
};

TEST_F(ApiKeyFileTest, OneThatIsWrongIsRefusedWithFlagAndPath) {
  const auto open = [this] {
    return ApiKeys::Open(path_, [] { return absl::Time(); }, {}).status();
  };
  const std::string named = absl::StrCat("--api-keys = ", path_);
  EXPECT_THAT(open(), StatusIs(kInvalid, AllOf(HasSubstr(named),
                                               HasSubstr("No such file"))));
  Write("");
  EXPECT_THAT(open(),
              StatusIs(kInvalid, AllOf(HasSubstr(named), HasSubstr("empty"))));
  Write("alice");
  EXPECT_THAT(open(),
              StatusIs(kInvalid, AllOf(HasSubstr(named), HasSubstr("line 1"))));
  Write(std::string((1 << 20) + 1, '#'));
  EXPECT_THAT(open(), StatusIs(kInvalid, HasSubstr("more than 1 MiB")));
  std::filesystem::remove(path_);
  std::filesystem::create_directory(path_);
  EXPECT_THAT(open(), StatusIs(kInvalid, HasSubstr("no regular file")));
}

TEST_F(ApiKeyFileTest, AChangeHoldsAfterASecond) {
  Write(alice_);
  Open();
  EXPECT_TRUE(Knows("a"));
  Write(bob_);  // as many bytes, maybe the same time of modification
  now_ += absl::Milliseconds(999);
  EXPECT_TRUE(Knows("a"));
  now_ += absl::Milliseconds(1);
  EXPECT_FALSE(Knows("a"));
  EXPECT_TRUE(Knows("b"));
  ASSERT_EQ(reloads_.size(), 1);
  EXPECT_THAT(reloads_[0], IsOk());
}

TEST_F(ApiKeyFileTest, AChangeHoldsThoughTheClockWasSetBack) {
  Write(alice_);
  Open();
  Write(bob_);
  now_ -= absl::Hours(1);
  EXPECT_TRUE(Knows("b"));
}

TEST_F(ApiKeyFileTest, ABrokenOneKeepsTheKeysBeforeAndIsToldOnce) {
  Write(alice_);
  Open();
  Write(absl::StrCat(bob_, "carol lab"));
  for (int i = 0; i < 3; ++i) {
    now_ += absl::Seconds(1);
    EXPECT_TRUE(Knows("a"));
    EXPECT_FALSE(Knows("b"));
  }
  ASSERT_EQ(reloads_.size(), 1);
  EXPECT_THAT(reloads_[0],
              StatusIs(kInvalid, AllOf(HasSubstr(path_), HasSubstr("line 2"))));
  std::filesystem::remove(path_);
  now_ += absl::Seconds(1);
  EXPECT_TRUE(Knows("a"));
  ASSERT_EQ(reloads_.size(), 2);
  EXPECT_THAT(reloads_[1], StatusIs(kInvalid, HasSubstr("No such file")));
  Write(bob_);
  now_ += absl::Seconds(1);
  EXPECT_TRUE(Knows("b"));
  EXPECT_FALSE(Knows("a"));
  ASSERT_EQ(reloads_.size(), 3);
  EXPECT_THAT(reloads_[2], IsOk());
}

}  // namespace
}  // namespace isomatch
