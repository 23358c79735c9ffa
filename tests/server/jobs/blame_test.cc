#include "server/jobs/blame.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr std::int64_t kExpected = 1000;

JobRecord Ran(const std::string& id, int attempt = 1) {
  JobRecord record;
  record.id = id;
  record.state = JobState::kRunning;
  record.attempt = attempt;
  return record;
}

JobTrace Silent(const std::string& id, absl::Duration silent) {
  return {id, 1, silent};
}

JobTrace Unanswered(const std::string& id, absl::Duration unanswered) {
  return {id, 1, absl::ZeroDuration(), unanswered};
}

const std::vector<JobRecord> kBoth = {Ran("a"), Ran("b")};

TEST(JobsToBlameTest, AKillAtNormalMemoryBlamesNobody) {
  EXPECT_THAT(JobsToBlame({}, kBoth), IsEmpty());
  EXPECT_THAT(
      JobsToBlame({kExpected, kExpected, {Silent("a", absl::Minutes(5))}},
                  kBoth),
      IsEmpty());
}

TEST(JobsToBlameTest, BeyondWhatIsReservedItIsTheMostSilent) {
  const auto blamed = [](absl::Duration a, absl::Duration b) {
    return JobsToBlame(
        {kExpected + 1, kExpected, {Silent("a", a), Silent("b", b)}}, kBoth);
  };
  EXPECT_THAT(blamed(absl::Seconds(1), absl::Milliseconds(100)),
              ElementsAre("a"));
  EXPECT_THAT(blamed(absl::Seconds(3), absl::Seconds(4)), ElementsAre("b"));
  // Both tell of their progress: it may be either.
  EXPECT_THAT(blamed(absl::Milliseconds(900), absl::Milliseconds(100)),
              IsEmpty());
}

TEST(JobsToBlameTest, BeyondWhatIsReservedTheOnlyOneIsToBlame) {
  EXPECT_THAT(
      JobsToBlame(
          {kExpected + 1, kExpected, {Silent("a", absl::ZeroDuration())}},
          {Ran("a")}),
      ElementsAre("a"));
}

TEST(JobsToBlameTest, OneThatDoesNotStopGoesBeforeMemory) {
  EXPECT_THAT(JobsToBlame({kExpected + 1,
                           kExpected,
                           {Unanswered("a", absl::Seconds(1)),
                            Silent("b", absl::Minutes(1))}},
                          kBoth),
              ElementsAre("a"));
  // It was about to.
  EXPECT_THAT(
      JobsToBlame({0, kExpected, {Unanswered("a", absl::Milliseconds(900))}},
                  kBoth),
      IsEmpty());
}

TEST(JobsToBlameTest, OneThatIsTerminalByNowLeavesTheOthersInnocent) {
  EXPECT_THAT(JobsToBlame({kExpected + 1,
                           kExpected,
                           {Unanswered("cancelled", absl::Seconds(9)),
                            Silent("b", absl::Minutes(1))}},
                          {Ran("b")}),
              IsEmpty());
}

TEST(JobsToBlameTest, AnotherAttemptIsAnotherMatter) {
  EXPECT_THAT(JobsToBlame({0, kExpected, {Unanswered("a", absl::Seconds(9))}},
                          {Ran("a", 2)}),
              IsEmpty());
}

}  // namespace
}  // namespace isomatch
