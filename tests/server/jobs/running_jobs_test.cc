#include "server/jobs/running_jobs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

class RunningJobsTest : public testing::Test {
 protected:
  absl::Duration now_ = absl::Seconds(100);
  RunningJobs runs_{[this] { return now_; }};
};

TEST_F(RunningJobsTest, OnlyOneThatWasAskedIsStuckAndOnce) {
  runs_.Begin("a", 7);
  EXPECT_FALSE(runs_.SetStuck("a"));
  runs_.OnAskedToStop("a");
  EXPECT_TRUE(runs_.SetStuck("a"));
  EXPECT_FALSE(runs_.SetStuck("a"));
  EXPECT_FALSE(runs_.SetStuck("b"));
  EXPECT_TRUE(runs_.End("a"));
}

TEST_F(RunningJobsTest, TheNextRunOfAJobIsAnotherOne) {
  runs_.Begin("a", 7);
  runs_.OnAskedToStop("a");
  now_ += absl::Seconds(10);
  EXPECT_THAT(runs_.Unanswered(absl::Seconds(10)), ElementsAre("a"));
  EXPECT_FALSE(runs_.End("a"));  // it answers, and starts again
  runs_.Begin("a", 7);
  EXPECT_FALSE(runs_.SetStuck("a"));
  EXPECT_THAT(runs_.Unanswered(absl::ZeroDuration()), IsEmpty());
}

TEST_F(RunningJobsTest, TracesTellAllThatIsKnown) {
  EXPECT_TRUE(runs_.IsEmpty());
  runs_.Begin("a", 7);
  runs_.SetAttempt("a", 3);
  runs_.OnAskedToStop("a");
  now_ += absl::Seconds(2);
  runs_.OnProgress("a", {});
  now_ += absl::Seconds(1);
  runs_.SetStuck("a");
  const std::vector<JobTrace> traces = runs_.Traces();
  ASSERT_THAT(traces, SizeIs(1));
  EXPECT_EQ(traces[0].id, "a");
  EXPECT_EQ(traces[0].attempt, 3);
  EXPECT_EQ(traces[0].silent, absl::Seconds(1));
  EXPECT_EQ(traces[0].unanswered, absl::Seconds(3));
  EXPECT_TRUE(traces[0].is_stuck);
  EXPECT_EQ(traces[0].resident_at_begin, 7);
  EXPECT_THAT(runs_.Ids(), IsEmpty());
  EXPECT_FALSE(runs_.IsEmpty());
}

}  // namespace
}  // namespace isomatch
