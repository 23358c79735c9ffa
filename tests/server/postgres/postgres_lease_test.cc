#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/time/clock.h"
#include "server/postgres/postgres_job_store.h"
#include "tests/server/postgres/postgres_queue_fixture.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::_;
using testing::ElementsAre;
using testing::IsEmpty;

TEST_F(PostgresQueueTest, ALateWorkerChangesNothing) {
  Insert(Job("a"));
  const JobRecord first = ClaimAndExpire("a");
  EXPECT_TRUE(*store().TakeBack(first, 1));
  EXPECT_FALSE(*store().TakeBack(first, 1));  // whoever else does the chores
  const auto second = store().Claim(Asking());
  ASSERT_TRUE(second.ok() && second->has_value());
  EXPECT_NE((*second)->claim, first.claim);
  EXPECT_EQ((*second)->faults, 1);
  EXPECT_EQ((*second)->attempt, 2);
  JobRecord late = first;
  late.state = JobState::kFailed;
  EXPECT_THAT(store().Update(late), StatusIs(absl::StatusCode::kAborted, _));
  EXPECT_THAT(*store().Renew({{"a", first.claim, {}}}, absl::Seconds(15)),
              ElementsAre("a"));
  EXPECT_THAT(*store().Renew({{"a", (*second)->claim, {3, 0.5, 0.25}}},
                             absl::Seconds(15)),
              IsEmpty());
  EXPECT_EQ(store().Get("a")->progress.total_fraction, 0.25);
}

TEST_F(PostgresQueueTest, AFirstMapIsToldUntilAnotherTakesTheJob) {
  Insert(Job("a"));
  const auto first = store().Claim(Asking(100, absl::Milliseconds(1)));
  ASSERT_TRUE(first.ok() && first->has_value());
  EXPECT_FALSE((*first)->progress.has_map);
  const auto renew = [&](bool has_map) {
    EXPECT_THAT(
        *store().Renew({{"a", (*first)->claim, {8, 0.5, 0.25, has_map}}},
                       absl::Milliseconds(1)),
        IsEmpty());
    return *store().Get("a");
  };
  const JobRecord without = renew(false);
  EXPECT_FALSE(without.progress.has_map);
  const JobRecord with = renew(true);
  EXPECT_TRUE(with.progress.has_map);
  EXPECT_EQ(with.progress.total_fraction, 0.25);
  // Watchers wait for another sequence.
  EXPECT_GT(with.sequence, without.sequence);
  EXPECT_EQ(renew(true).sequence, with.sequence);
  absl::SleepFor(absl::Milliseconds(20));
  EXPECT_TRUE(*store().TakeBack(with, 1));
  EXPECT_FALSE(store().Get("a")->progress.has_map);
  const auto second = store().Claim(Asking());
  ASSERT_TRUE(second.ok() && second->has_value());
  EXPECT_FALSE((*second)->progress.has_map);
}

TEST_F(PostgresQueueTest, ALeaseThatIsRenewedIsNotTakenBack) {
  Insert(Job("a"));
  const JobRecord claimed = ClaimAndExpire("a");
  EXPECT_THAT(*store().Renew({{"a", claimed.claim, {}}}, absl::Seconds(15)),
              IsEmpty());
  EXPECT_THAT(*store().Expired(absl::ZeroDuration()), IsEmpty());
  EXPECT_FALSE(*store().TakeBack(claimed, 1));
}

TEST_F(PostgresQueueTest, NoLeaseEndsWhileTheDatabaseHasJustStarted) {
  Insert(Job("a"));
  EXPECT_EQ(ClaimId(Asking(100, absl::Milliseconds(1))), "a");
  absl::SleepFor(absl::Milliseconds(20));
  EXPECT_THAT(*store().Expired(absl::Hours(24)), IsEmpty());
}

TEST_F(PostgresQueueTest, AnEndedJobIsLostToItsWorker) {
  Insert(Job("a"));
  const auto claimed = store().Claim(Asking());
  JobRecord cancelled = *store().Get("a");
  cancelled.state = JobState::kCancelled;
  ASSERT_THAT(store().Update(cancelled), IsOk());
  EXPECT_THAT(*store().Renew({{"a", (*claimed)->claim, {}}}, absl::Seconds(15)),
              ElementsAre("a"));
  EXPECT_THAT(*store().LiveSequences({"a"}), IsEmpty());
}
}  // namespace
}  // namespace isomatch
