#include "server/jobs/blame.h"

#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::FieldsAre;
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
  return {.id = id, .attempt = 1, .silent = silent};
}

JobTrace Unanswered(const std::string& id, absl::Duration unanswered) {
  return {.id = id, .attempt = 1, .unanswered = unanswered};
}

const std::vector<JobRecord> kBoth = {Ran("a"), Ran("b")};

std::set<std::string> JobsToBlame(const ProcessTrace& trace,
                                  const std::vector<JobRecord>& ran) {
  return WhoIsToBlame(trace, ran).jobs;
}

TEST(BlameTest, AKillAtNormalMemoryBlamesNobody) {
  EXPECT_THAT(JobsToBlame({}, kBoth), IsEmpty());
  EXPECT_THAT(
      JobsToBlame({kExpected, kExpected, {Silent("a", absl::Minutes(5))}},
                  kBoth),
      IsEmpty());
}

TEST(BlameTest, BeyondWhatIsReservedItIsTheMostSilent) {
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

TEST(BlameTest, TheOnlyOneIsToBlameIfItIsSilentOrMemoryHasGrown) {
  constexpr std::int64_t kOthers = std::int64_t{512} << 20;
  JobRecord ran = Ran("a");
  ran.memory_estimate_bytes = 100;
  JobTrace job = Silent("a", absl::Milliseconds(900));
  job.resident_at_begin = 10'000;
  const auto blamed = [&](std::int64_t resident) {
    return WhoIsToBlame({resident, kExpected, {job}}, {ran}).jobs;
  };
  EXPECT_THAT(blamed(10'100 + kOthers), IsEmpty());
  EXPECT_THAT(blamed(10'101 + kOthers), ElementsAre("a"));
  job.silent = absl::Seconds(1);
  EXPECT_THAT(blamed(kExpected), IsEmpty());
  EXPECT_THAT(blamed(kExpected + 1), ElementsAre("a"));
}

TEST(BlameTest, OneThatIsStuckIsAloneToBlame) {
  JobTrace stuck = Unanswered("stuck", absl::Seconds(20));
  stuck.is_stuck = true;
  const ProcessTrace trace = {kExpected + 1,
                              kExpected,
                              {Unanswered("a", absl::Seconds(2)), stuck,
                               Silent("b", absl::Minutes(1))}};
  EXPECT_THAT(WhoIsToBlame(trace, kBoth), FieldsAre(true, IsEmpty()));
  EXPECT_THAT(WhoIsToBlame(trace, {Ran("a"), Ran("stuck")}),
              FieldsAre(true, ElementsAre("stuck")));
}

TEST(BlameTest, WhetherItIsKnownIsAnotherMatter) {
  EXPECT_FALSE(WhoIsToBlame({}, kBoth).is_known);
  EXPECT_TRUE(
      WhoIsToBlame({0, kExpected, {Unanswered("c", absl::Seconds(9))}}, kBoth)
          .is_known);
}

TEST(BlameTest, OneThatDoesNotStopGoesBeforeMemory) {
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

TEST(BlameTest, OneThatIsTerminalByNowLeavesTheOthersInnocent) {
  EXPECT_THAT(JobsToBlame({kExpected + 1,
                           kExpected,
                           {Unanswered("cancelled", absl::Seconds(9)),
                            Silent("b", absl::Minutes(1))}},
                          {Ran("b")}),
              IsEmpty());
}

TEST(BlameTest, AnotherAttemptIsAnotherMatter) {
  EXPECT_THAT(JobsToBlame({0, kExpected, {Unanswered("a", absl::Seconds(9))}},
                          {Ran("a", 2)}),
              IsEmpty());
}

}  // namespace
}  // namespace isomatch
