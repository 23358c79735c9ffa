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
       {-absl::Hours(1000), absl::ZeroDuration(), absl::Minutes(59)}) {
    RetentionClock clock = Start(wall_ - ahead);
    for (int i = 0; i < 100; ++i) {
      EXPECT_TRUE(clock.IsBelieved());
      Pass(absl::Minutes(1));
    }
  }
  EXPECT_THAT(told_, IsEmpty());
  EXPECT_GE(*saved_, wall_ - absl::Minutes(12));
}

TEST_F(RetentionClockTest, OneThatIsAheadAtTheStartHasToStandTheTest) {
  RetentionClock clock = Start(wall_ - absl::Hours(24 * 8));
  EXPECT_FALSE(clock.IsBelieved());
  EXPECT_THAT(told_, ElementsAre(false));
  Pass(absl::Minutes(9));
  EXPECT_FALSE(clock.IsBelieved());
  EXPECT_FALSE(saved_.has_value());
  Pass(absl::Minutes(1));
  EXPECT_TRUE(clock.IsBelieved());
  EXPECT_THAT(told_, ElementsAre(false, true));
  EXPECT_EQ(saved_, wall_);
}

TEST_F(RetentionClockTest, OneThatIsPutRightMeanwhileNeverDeletes) {
  RetentionClock clock = Start(wall_ - absl::Hours(24 * 8));
  EXPECT_FALSE(clock.IsBelieved());
  Pass(absl::Minutes(5));
  wall_ -= absl::Hours(24 * 8);
  EXPECT_FALSE(clock.IsBelieved());
  Pass(absl::Minutes(9));
  EXPECT_FALSE(clock.IsBelieved());
  Pass(absl::Minutes(1));
  EXPECT_TRUE(clock.IsBelieved());
}

TEST_F(RetentionClockTest, OneThatJumpsWhileTheServerRunsIsNotBelieved) {
  RetentionClock clock = Start(std::nullopt);
  EXPECT_TRUE(clock.IsBelieved());
  Pass(absl::Minutes(1));
  wall_ += absl::Hours(24 * 8);
  EXPECT_FALSE(clock.IsBelieved());
  Pass(RetentionClock::kGrace);
  EXPECT_TRUE(clock.IsBelieved());
  EXPECT_THAT(told_, ElementsAre(false, true));
}

}  // namespace
}  // namespace isomatch
