#include "server/jobs/disconnect_guard.h"

#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/jobs/job_manager_fixture.h"
#include "tests/server/manual_executor.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

class NoWatcher : public JobWatcher {
 public:
  void OnJobChanged() override {}
};

class DisconnectGuardTest : public testing::Test {
 protected:
  void Watch() { watchers_.Add("a", watcher_); }
  void Leave() { watchers_.Remove("a", watcher_.get()); }

  std::vector<std::string> cancelled_;
  ManualExecutor timers_;
  const std::shared_ptr<JobWatcher> watcher_ = std::make_shared<NoWatcher>();
  Watchers watchers_{[this](const std::string& id) { guard_.OnUnwatched(id); }};
  DisconnectGuard guard_{
      absl::Seconds(10), &timers_, &watchers_,
      [this](const std::string& id) { cancelled_.push_back(id); }};
};

TEST_F(DisconnectGuardTest, AJobThatNobodyEverWatchedIsCancelledOnce) {
  guard_.Guard("a");
  timers_.Advance(absl::Seconds(9));
  EXPECT_THAT(cancelled_, IsEmpty());
  timers_.Advance(absl::Seconds(1));
  EXPECT_THAT(cancelled_, ElementsAre("a"));
  timers_.Advance(absl::Hours(1));
  EXPECT_THAT(cancelled_, ElementsAre("a"));
}

TEST_F(DisconnectGuardTest, AWatcherKeepsItForAsLongAsItWatches) {
  guard_.Guard("a");
  Watch();
  timers_.Advance(absl::Hours(1));
  EXPECT_THAT(cancelled_, IsEmpty());
  Leave();
  timers_.Advance(absl::Seconds(9));
  EXPECT_THAT(cancelled_, IsEmpty());
  timers_.Advance(absl::Seconds(1));
  EXPECT_THAT(cancelled_, ElementsAre("a"));
}

TEST_F(DisconnectGuardTest, AReconnectWithinThePeriodBeginsAWholeNewOne) {
  guard_.Guard("a");
  for (int i = 0; i < 5; ++i) {
    timers_.Advance(absl::Seconds(9));
    Watch();
    Leave();
  }
  timers_.Advance(absl::Seconds(9));
  EXPECT_THAT(cancelled_, IsEmpty());
  timers_.Advance(absl::Seconds(1));
  EXPECT_THAT(cancelled_, ElementsAre("a"));
}

TEST_F(DisconnectGuardTest, OneWatcherOfTwoIsEnough) {
  const auto other = std::make_shared<NoWatcher>();
  guard_.Guard("a");
  Watch();
  watchers_.Add("a", other);
  Leave();
  timers_.Advance(absl::Minutes(1));
  EXPECT_THAT(cancelled_, IsEmpty());
  watchers_.Remove("a", other.get());
  timers_.Advance(absl::Seconds(10));
  EXPECT_THAT(cancelled_, ElementsAre("a"));
}

TEST_F(DisconnectGuardTest, JobsThatAreNotGuardedOrReleasedAreLeftAlone) {
  Watch();
  Leave();
  EXPECT_EQ(timers_.live_timers(), 0);
  guard_.Guard("a");
  guard_.Guard("b");
  guard_.Release("a");
  EXPECT_EQ(timers_.live_timers(), 1);
  guard_.ReleaseAll();
  EXPECT_EQ(timers_.live_timers(), 0);
  timers_.Advance(absl::Minutes(1));
  EXPECT_THAT(cancelled_, IsEmpty());
}

TEST_F(DisconnectGuardTest, ATimerOfAnOlderPeriodThatHasBegunDoesNothing) {
  BegunTimers timers;
  DisconnectGuard guard(
      absl::Seconds(10), &timers, &watchers_,
      [this](const std::string& id) { cancelled_.push_back(id); });
  guard.Guard("a");
  guard.OnUnwatched("a");
  timers.Run(0);
  EXPECT_THAT(cancelled_, IsEmpty());
  timers.Run(1);
  EXPECT_THAT(cancelled_, ElementsAre("a"));
}

class UnwatchedJobTest : public JobManagerTest {
 protected:
  static JobSpec CancelledWhenUnwatched() {
    JobSpec spec = Needing(1);
    spec.cancel_when_unwatched = true;
    return spec;
  }
};

TEST_F(UnwatchedJobTest, IsCancelledOnlyIfItWantsIt) {
  const std::string kept = Create();
  const std::string dropped = Create(CancelledWhenUnwatched());
  timers_.Advance(DisconnectGuard::kGrace);
  EXPECT_EQ(StateOf(kept), "QUEUED");
  EXPECT_EQ(StateOf(dropped), "CANCELLED");
}

TEST_F(UnwatchedJobTest, IsStoppedWhileItRuns) {
  const std::string id = Create(CancelledWhenUnwatched());
  during_match_ = [&](const std::stop_token& stop) {
    timers_.Advance(DisconnectGuard::kGrace);
    EXPECT_TRUE(stop.stop_requested());
    return absl::CancelledError("stopped");
  };
  workers_.RunNext();
  EXPECT_EQ(StateOf(id), "CANCELLED");
}

TEST_F(UnwatchedJobTest, IsLeftAloneWhenItHasEnded) {
  const std::string id = Create(CancelledWhenUnwatched());
  const auto watcher = std::make_shared<NoWatcher>();
  manager_->watchers().Add(id, watcher);
  workers_.RunNext();
  manager_->watchers().Remove(id, watcher.get());
  EXPECT_EQ(timers_.live_timers(), 0);
  EXPECT_EQ(StateOf(id), "SUCCEEDED");
}

TEST_F(UnwatchedJobTest, LeavesNoTimerWhenItIsRefused) {
  JobRecord other;
  other.id = "job1";
  ASSERT_THAT(jobs_.Insert(other), IsOk());  // the id is taken
  EXPECT_FALSE(manager_->Create(caller_, CancelledWhenUnwatched()).ok());
  EXPECT_EQ(timers_.live_timers(), 0);
}

TEST_F(UnwatchedJobTest, LeavesNoTimerAfterShutdown) {
  Create(CancelledWhenUnwatched());
  Create(CancelledWhenUnwatched());
  during_match_ = [&](const std::stop_token&) {
    manager_->BeginDrain();
    return absl::OkStatus();
  };
  workers_.RunNext();
  manager_->Shutdown(absl::ZeroDuration());
  EXPECT_EQ(timers_.live_timers(), 0);
}

}  // namespace
}  // namespace isomatch
