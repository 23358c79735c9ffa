#include "client/cli/page_opener.h"

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "client/files/mesh_file.h"
#include "client/files/text_file.h"
#include "tests/client/cli/run_isomatch.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::StartsWith;

/// An environment variable that has another value until the end of a test.
class Variable {
 public:
  Variable(const char* name, const std::string& value) : name_(name) {
    if (const char* before = std::getenv(name)) before_ = before;
    setenv(name, value.c_str(), 1);
  }
  ~Variable() {
    if (before_) {
      setenv(name_, before_->c_str(), 1);
    } else {
      unsetenv(name_);
    }
  }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;

 private:
  const char* const name_;
  std::optional<std::string> before_;
};

/// `isomatch view` of a pair without a place to write to.
class PageOpenerTest : public testing::Test {
 protected:
  PageOpenerTest() {
    EXPECT_THAT(WriteMesh(mesh_, BumpySphere(0)), IsOk());
    std::string map;
    for (int i = 0; i < 12; ++i) absl::StrAppend(&map, i, "\n");
    map_ = folder_.Write("map.txt", map);
  }

  CommandOutcome View() { return RunIsomatch({"view", mesh_, mesh_, map_}); }

  /// Puts an xdg-open into PATH that writes what it is asked to open.
  void InstallXdgOpen() {
    const std::string program = folder_.Write(
        "xdg-open",
        absl::StrCat("#!/bin/sh\nprintf %s \"$1\" > ", folder_.Path("part"),
                     "\nmv ", folder_.Path("part"), " ", opened_, "\n"));
    fs::permissions(program, fs::perms::owner_all);
  }

  TemporaryFolder folder_;
  const std::string mesh_ = folder_.Path("x.off");
  const std::string opened_ = folder_.Path("opened");
  std::string map_;
  const Variable temporary_{"TMPDIR", folder_.Path("")};
  const Variable wayland_{"WAYLAND_DISPLAY", ""};
  const Variable path_{"PATH", folder_.Path("") + ":/usr/bin:/bin"};
};

TEST_F(PageOpenerTest, OpensThePageWhereThereIsADisplay) {
  const Variable display("DISPLAY", ":0");
  InstallXdgOpen();
  const CommandOutcome outcome = View();
  ASSERT_EQ(outcome.status, kExitSuccess) << outcome.err;
  const std::string page = outcome.out.substr(0, outcome.out.find(": "));
  EXPECT_THAT(page, StartsWith(folder_.Path("isomatch-view-")));
  EXPECT_THAT(page, testing::EndsWith("/x__x.html"));
  EXPECT_THAT(outcome.out, HasSubstr(": opened in the browser\n"));
  EXPECT_THAT(ReadFile(page, "a page").value(), StartsWith("<!doctype html>"));
  EXPECT_EQ(fs::status(fs::path(page).parent_path()).permissions(),
            fs::perms::owner_all);
  for (int i = 0; i < 500 && !fs::exists(opened_); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  EXPECT_EQ(ReadFile(opened_, "what was opened").value_or(""), page);
}

TEST_F(PageOpenerTest, SaysWhereThePageIsWithoutADisplay) {
  const Variable display("DISPLAY", "");
  InstallXdgOpen();
  const CommandOutcome outcome = View();
  ASSERT_EQ(outcome.status, kExitSuccess) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("/x__x.html: open it in a browser; there "
                                     "is no display here\n"));
  EXPECT_FALSE(fs::exists(opened_));
}

TEST_F(PageOpenerTest, SaysThatThereIsNoXdgOpen) {
  const Variable display("DISPLAY", ":0");
  const Variable path("PATH", folder_.Path(""));
  EXPECT_THAT(View().out,
              HasSubstr("open it in a browser (there is no xdg-open)\n"));
}

TEST_F(PageOpenerTest, NothingIsLeftWhenThePairCannotBeShown) {
  map_ = folder_.Write("short.txt", "0\n");
  const int files = folder_.CountFiles();
  EXPECT_EQ(View().status, kExitUsage);
  EXPECT_EQ(folder_.CountFiles(), files);
}

TEST_F(PageOpenerTest, SaysThatThereIsNoPlaceForAPage) {
  const Variable temporary("TMPDIR", folder_.Path("none"));
  const CommandOutcome outcome = View();
  EXPECT_EQ(outcome.status, kExitFailure);
  EXPECT_THAT(outcome.err, HasSubstr("say where the page goes by --output"));
}

}  // namespace
}  // namespace isomatch
