// The server is killed with SIGKILL, again and again, at points that chance
// chooses: while it starts, accepts, runs, stores and forgets jobs. What a
// client was told must hold ever after.

#include <csignal>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "tests/soak/figures.h"
#include "tests/soak/soak_server.h"
#include "tests/soak/told_jobs.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

class KillTest : public testing::Test {
 protected:
  std::vector<std::string> Flags() const {
    return {"--data-dir",        folder_.Path("data"),
            "--workers",         "2",
            "--max-kept-jobs",   "1000000",
            "--max-queued-jobs", "1000",
            "--threads-per-job", "1"};
  }

  int Random(int bound) { return told_.Random(bound); }

  void KillWhileItStarts();
  void KillWhileItWorks();
  void CheckAtTheEnd() {
    SoakServer server(Flags());
    told_.CheckAtTheEnd(server.stub());
  }

  const TemporaryFolder folder_;
  ToldJobs told_{PrintedSeed(), /*least_attempts=*/10};
  int cycle_ = 0;
};

void KillTest::KillWhileItStarts() {
  std::vector<std::string> flags = Flags();
  flags.insert(flags.end(),
               {"--listen", "127.0.0.1:0", "--metrics-listen", "off"});
  ChildProcess server(ISOMATCH_SERVER_BINARY, flags);
  absl::SleepFor(absl::Milliseconds(Random(80)));
  server.Signal(SIGKILL);
  EXPECT_EQ(server.ExitStatus(), -1);
}

void KillTest::KillWhileItWorks() {
  SoakServer server(Flags());
  // Now and then long enough for each job to end: ten kills fail it.
  const int most = Random(4) == 0 ? 400 : 100;
  std::thread killer([&server, wait = absl::Milliseconds(Random(most))] {
    absl::SleepFor(wait);
    server.Signal(SIGKILL);
  });
  while (told_.Step(server.stub(), absl::StrCat("cycle ", cycle_))) {
  }
  killer.join();
  EXPECT_EQ(server.ExitStatus(), -1);
}

TEST_F(KillTest, WhatAClientWasToldHoldsAfterEachKill) {
  const int cycles = Rounds("ISOMATCH_KILLS", 200, 500);
  for (cycle_ = 0; cycle_ < cycles && !HasFailure(); ++cycle_) {
    Random(8) == 0 ? KillWhileItStarts() : KillWhileItWorks();
  }
  CheckAtTheEnd();
  PrintFigure("kill -9: cycles", cycle_, "");
  PrintFigure("kill -9: jobs", told_.sent(), "");
  ExpectAtMost("kill -9: accepted jobs lost", told_.lost(), 0, "");
  ExpectAtMost("kill -9: results or states wrong", told_.wrong(), 0, "");
  ExpectAtMost("kill -9: jobs ended by it (CRASHED_REPEATEDLY)",
               told_.given_up(), 0, "");
}

}  // namespace
}  // namespace isomatch
