#include "server/jobs/retention_clock.h"

#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

class RetentionClockTest : public testing::Test {
 protected:
  RetentionClock Start(std::optional<absl::Time> last_seen) {
    return RetentionClock({.now = [this] { return wall_; },
                           .steady = [this] { return steady_; },
                           .save = [this](absl::Time time) { saved_ = time; },
                           .on_change =
                               [this](bool is_believed, const std::string&) {
                                 told_.push_back(is_believed);
                               }},
                          last_seen);
  }

  void Pass(absl::Duration time) {
    wall_ += time;
    steady_ += time;
  }

  absl::Time wall_ = absl::FromUnixSeconds(1'800'000'000);
  absl::Duration steady_ = absl::Hours(5);
  std::optional<absl::Time> saved_;
  std::vector<bool> told_;
};

TEST_F(RetentionClockTest, AClockThatGoesOnIsBelieved) {
  for (const absl::Duration ahead :
       {-absl::Minutes(59), absl::ZeroDuration(), absl::Minutes(59)}) {
    RetentionClock clock = Start(wall_ - ahead);
    for (int i = 0; i < 100; ++i) {
      EXPECT_EQ(clock.Now(), wall_);
      Pass(absl::Minutes(1));
    }
  }
  EXPECT_THAT(told_, IsEmpty());
  EXPECT_GE(*saved_, wall_ - absl::Minutes(12));
}

TEST_F(RetentionClockTest, OneThatIsAheadAtTheStartHasToStandTheTest) {
  const absl::Time last_seen = wall_ - absl::Hours(24 * 8);
  RetentionClock clock = Start(last_seen);
  EXPECT_EQ(clock.Now(), last_seen);
  EXPECT_THAT(told_, ElementsAre(false));
  Pass(RetentionClock::kGrace - absl::Minutes(1));
  const absl::Time grown =
      last_seen + RetentionClock::kGrace - absl::Minutes(1);
  EXPECT_EQ(clock.Now(), grown);  // time passes, but no more than that
  EXPECT_EQ(saved_, grown);       // also for the next process
  Pass(absl::Minutes(1));
  EXPECT_EQ(clock.Now(), wall_);
  EXPECT_THAT(told_, ElementsAre(false, true));
  EXPECT_EQ(saved_, wall_);
}

TEST_F(RetentionClockTest, OneThatIsBehindAtTheStartIsNotBelievedEither) {
  RetentionClock clock = Start(wall_ + absl::Hours(24 * 365));
  EXPECT_EQ(clock.Now(), wall_);  // what is later would not be safe
  EXPECT_THAT(told_, ElementsAre(false));
  Pass(absl::Minutes(5));
  wall_ += absl::Hours(24 * 365 * 50);  // "put right", too far
  EXPECT_LT(clock.Now(), wall_ - absl::Hours(24 * 365 * 40));
}

TEST_F(RetentionClockTest, AMachineThatIsOffEachNightStillAgesItsJobs) {
  const absl::Time begin = wall_;
  std::optional<absl::Time> last_seen = begin;
  for (int day = 0; day < 10; ++day) {
    wall_ += absl::Hours(16);
    RetentionClock clock = Start(last_seen);
    clock.Now();
    Pass(absl::Hours(8));
    clock.Now();
    last_seen = saved_;
  }
  EXPECT_GE(Start(last_seen).Now(), begin + absl::Hours(80));
}

TEST_F(RetentionClockTest, OneThatIsPutRightMeanwhileNeverDeletes) {
  const absl::Time last_seen = wall_ - absl::Hours(24 * 8);
  RetentionClock clock = Start(last_seen);
  EXPECT_EQ(clock.Now(), last_seen);
  Pass(absl::Minutes(35));
  wall_ -= absl::Hours(24 * 8);
  EXPECT_EQ(clock.Now(), wall_);
  Pass(RetentionClock::kGrace);
  EXPECT_EQ(clock.Now(), wall_);
  EXPECT_THAT(told_, ElementsAre(false, false, true));
}

TEST_F(RetentionClockTest, OneThatJumpsWhileTheServerRunsIsNotBelieved) {
  RetentionClock clock = Start(std::nullopt);
  const absl::Time begin = wall_;
  EXPECT_EQ(clock.Now(), begin);
  Pass(absl::Minutes(1));
  wall_ += absl::Hours(24 * 8);
  EXPECT_EQ(clock.Now(), begin + absl::Minutes(1));
  EXPECT_EQ(clock.Latest(), wall_);
  Pass(RetentionClock::kGrace);
  EXPECT_EQ(clock.Now(), wall_);
  EXPECT_EQ(clock.Latest(), wall_);
  EXPECT_THAT(told_, ElementsAre(false, true));
}

TEST_F(RetentionClockTest,
       WhatEndsWhileTheClockIsBehindAgesFromWhatIsBelieved) {
  RetentionClock clock = Start(std::nullopt);
  const absl::Time begin = wall_;
  Pass(absl::Minutes(1));
  wall_ -= absl::Hours(24 * 30);
  EXPECT_EQ(clock.Latest(), begin + absl::Minutes(1));
  EXPECT_EQ(clock.Now(), wall_);
}

}  // namespace
}  // namespace isomatch
