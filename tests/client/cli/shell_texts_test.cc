#include "client/cli/shell_texts.h"

#include <cstdlib>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "client/files/text_file.h"
#include "tests/client/cli/run_isomatch.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

TEST(ShellTextsTest, BashCompletesCommandsOptionsAndFiles) {
  const TemporaryFolder folder;
  const std::string script =
      folder.Write("script", RunIsomatch({"completion", "bash"}).out);
  folder.Write("mesh.off", "");
  const auto complete = [&](const std::string& words) {
    const std::string out = folder.Path("out");
    const std::string command =
        absl::StrCat("cd ", folder.Path("."), " && bash -c '. ", script,
                     "; COMP_WORDS=(isomatch ", words,
                     "); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _isomatch; "
                     "echo \"${COMPREPLY[*]}\"' > ",
                     out);
    EXPECT_EQ(std::system(command.c_str()), 0);
    return *ReadFile(out, "output");
  };
  EXPECT_EQ(complete("ma"), "match man\n");
  EXPECT_EQ(complete("match --prof"), "--profile\n");
  EXPECT_EQ(complete("watch --prof"), "\n");
  EXPECT_EQ(complete("match mes"), "mesh.off\n");
  EXPECT_EQ(complete("completion z"), "zsh\n");
  EXPECT_EQ(complete("help ma"), "match man\n");
  EXPECT_EQ(complete("match --profile p"), "paper\n");
  EXPECT_EQ(complete("view --layer d"), "distortion\n");
  EXPECT_EQ(complete("list --state r"), "running\n");
  EXPECT_EQ(complete("match --random-seed m"), "\n");
  EXPECT_EQ(complete("match --landmarks m"), "mesh.off\n");
  EXPECT_EQ(complete("batch --truth m"), "\n");
}

TEST(ShellTextsTest, ZshAndFishNameEveryCommandAndOption) {
  const std::string zsh = RunIsomatch({"completion", "zsh"}).out;
  EXPECT_THAT(zsh, AllOf(HasSubstr("#compdef isomatch"),
                         HasSubstr("'batch:Matches many pairs"),
                         HasSubstr("'--random-seed[")));
  const std::string fish = RunIsomatch({"completion", "fish"}).out;
  EXPECT_THAT(fish, AllOf(HasSubstr("__fish_use_subcommand -f -a evaluate"),
                          HasSubstr("-l output -s o -r"),
                          // A flag takes no value.
                          Not(HasSubstr("-l no-progress -r")),
                          HasSubstr("-l profile -x -a 'default paper'")));
  EXPECT_THAT(zsh, AllOf(HasSubstr(":value:(default paper)"),
                         HasSubstr(":folder:_files -/")));
}

TEST(ShellTextsTest, AnUnknownShellIsWrongUsage) {
  const CommandOutcome outcome = RunIsomatch({"completion", "tcsh"});
  EXPECT_EQ(outcome.status, kExitUsage);
  EXPECT_THAT(outcome.err, HasSubstr("fish"));
}

TEST(ShellTextsTest, TheManualPageHasEveryCommand) {
  const std::string page = RunIsomatch({"man"}).out;
  for (const char* command :
       {"match", "batch", "submit", "watch", "get", "list", "cancel", "delete",
        "upload", "info", "evaluate", "sample", "completion"}) {
    EXPECT_THAT(page, HasSubstr(absl::StrCat(".SS isomatch ", command)));
  }
  EXPECT_THAT(page, AllOf(HasSubstr(".B \\-\\-output, \\-o FILE"),
                          HasSubstr("ISOMATCH_SERVER")));
  // No line of text is taken for a request of roff.
  EXPECT_THAT(page, Not(HasSubstr("\n'")));
}

}  // namespace
}  // namespace isomatch
