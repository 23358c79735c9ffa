#include "server/jobs/partial_uploads.h"

#include <atomic>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "server/jobs/errors.h"
#include "server/machine/thread_pool.h"
#include "tests/server/manual_executor.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::_;

constexpr char kTenant[] = "default";

class PartialUploadsTest : public testing::Test {
 protected:
  /// An upload that has room for `room` bytes and has received `bytes`.
  PartialUpload Received(const std::string& bytes, std::int64_t room) {
    auto reserved = uploads_.Reserve(kTenant, room);
    EXPECT_THAT(reserved, IsOk());
    return {bytes, *std::move(reserved)};
  }

  void Keep(const std::string& sha256, const std::string& bytes) {
    uploads_.Keep({kTenant, sha256},
                  Received(bytes, static_cast<std::int64_t>(bytes.size())));
  }

  std::size_t Kept(const std::string& sha256) const {
    return uploads_.ReceivedBytes(kTenant, {sha256}).front();
  }

  MemoryBudget budget_{100};
  ManualExecutor timers_;
  TenantBudgets budgets_{&budget_, budget_.total_bytes()};
  MemoryPartialUploads uploads_{&budgets_, &timers_, absl::Minutes(5)};
};

TEST_F(PartialUploadsTest, WhatIsKeptTakesItsOwnRoomOnlyAndIsTakenOnce) {
  uploads_.Keep({kTenant, "a"}, Received("12345", 80));
  EXPECT_EQ(budget_.reserved_bytes(), 5);
  EXPECT_EQ(Kept("a"), 5);
  {
    const PartialUpload taken = *uploads_.Take({kTenant, "a"});
    EXPECT_EQ(taken.bytes, "12345");
    EXPECT_EQ(taken.reservation.bytes(), 5);
    EXPECT_EQ(Kept("a"), 0);
    EXPECT_EQ(uploads_.Take({kTenant, "a"})->bytes, "");
  }
  EXPECT_EQ(budget_.reserved_bytes(), 0);
  EXPECT_EQ(timers_.live_timers(), 0);
}

TEST_F(PartialUploadsTest, TenantsDoNotSeeEachOthersBytes) {
  Keep("a", "12345");
  EXPECT_EQ(uploads_.ReceivedBytes("other", {"a"}).front(), 0);
  EXPECT_EQ(uploads_.Take({"other", "a"})->bytes, "");
  EXPECT_EQ(Kept("a"), 5);
}

TEST_F(PartialUploadsTest, OfTwoUploadsTheLongerIsKept) {
  Keep("a", "12345");
  Keep("a", "123");
  EXPECT_EQ(Kept("a"), 5);
  Keep("a", "1234567");
  EXPECT_EQ(Kept("a"), 7);
  EXPECT_EQ(budget_.reserved_bytes(), 7);
}

TEST_F(PartialUploadsTest, ExpiresAfterItsTimeWhichBeginsAnewWithEachKeep) {
  Keep("a", "1");
  timers_.Advance(absl::Minutes(4));
  Keep("a", "12");
  Keep("b", "1");
  timers_.Advance(absl::Minutes(4));
  EXPECT_EQ(Kept("a"), 2);
  timers_.Advance(absl::Minutes(1));
  EXPECT_EQ(Kept("a"), 0);
  EXPECT_EQ(Kept("b"), 0);
  EXPECT_EQ(budget_.reserved_bytes(), 0);
}

TEST_F(PartialUploadsTest, ATimerOfWhatWasKeptBeforeDropsNothing) {
  BegunTimers timers;
  MemoryPartialUploads uploads(&budgets_, &timers, absl::Minutes(5));
  const BlobKey key{kTenant, "a"};
  for (int i = 0; i < 2; ++i) {
    EXPECT_THAT(uploads.Take(key), IsOk());
    uploads.Keep(key, {"x", *uploads.Reserve(kTenant, 1)});
  }
  timers.Run(0);
  EXPECT_EQ(uploads.ReceivedBytes(key.tenant, {key.sha256}).front(), 1);
  timers.Run(1);
  EXPECT_EQ(uploads.ReceivedBytes(key.tenant, {key.sha256}).front(), 0);
}

TEST_F(PartialUploadsTest, TheOldestGiveWayToWhatNeedsTheRoom) {
  for (const char* sha256 : {"b", "a", "c"}) {
    Keep(sha256, std::string(30, 'x'));
  }
  auto reserved = uploads_.Reserve(kTenant, 35);
  ASSERT_THAT(reserved, IsOk());
  EXPECT_EQ(Kept("b"), 0);
  EXPECT_EQ(Kept("a"), 30);
  EXPECT_EQ(Kept("c"), 30);
}

TEST_F(PartialUploadsTest, NothingGivesWayWhereItWouldNotHelp) {
  Keep("a", std::string(30, 'x'));
  auto active = uploads_.Reserve(kTenant, 60);
  ASSERT_THAT(active, IsOk());
  const auto refused = uploads_.Reserve(kTenant, 41);
  EXPECT_EQ(DetailsOf(refused.status()).reason, "UPLOAD_QUOTA");
  EXPECT_EQ(DetailsOf(refused.status()).retry_after, kRetryUploadQuota);
  EXPECT_THAT(uploads_.Reserve(kTenant, 101),
              StatusIs(absl::StatusCode::kResourceExhausted, _));
  EXPECT_EQ(Kept("a"), 30);
  EXPECT_THAT(uploads_.Reserve(kTenant, 40), IsOk());
}

TEST_F(PartialUploadsTest, ATenantHasItsShareAndLosesItsOwnFirst) {
  TenantBudgets budgets(&budget_, 60);
  MemoryPartialUploads uploads(&budgets, &timers_, absl::Minutes(5));
  const auto keep = [&](const std::string& tenant, const std::string& sha256,
                        int bytes) {
    auto reserved = uploads.Reserve(tenant, bytes);
    ASSERT_THAT(reserved, IsOk());
    uploads.Keep(
        {tenant, sha256},
        {std::string(static_cast<size_t>(bytes), 'x'), *std::move(reserved)});
  };
  keep("b", "b1", 30);
  keep("a", "a1", 30);
  keep("a", "a2", 30);
  EXPECT_THAT(uploads.CheckRoom("a", 60), IsOk());
  const absl::Status refused = uploads.CheckRoom("a", 61);
  EXPECT_EQ(DetailsOf(refused).reason, "UPLOAD_QUOTA");
  EXPECT_EQ(DetailsOf(refused).metadata.at("limit_bytes"), "60");
  // Its share is full: its own oldest goes.
  const auto active = uploads.Reserve("a", 30);
  ASSERT_THAT(active, IsOk());
  EXPECT_EQ(uploads.ReceivedBytes("a", {"a1"}).front(), 0);
  EXPECT_EQ(uploads.ReceivedBytes("b", {"b1"}).front(), 30);
  // The whole is full: who keeps most loses its oldest.
  keep("b", "b2", 10);
  const auto third = uploads.Reserve("c", 10);
  ASSERT_THAT(third, IsOk());
  EXPECT_EQ(uploads.ReceivedBytes("b", {"b1"}).front(), 0);
  EXPECT_EQ(uploads.ReceivedBytes("a", {"a2"}).front(), 30);
}

TEST_F(PartialUploadsTest, ManyTinyOnesOfOneTenantPushOutTheirOwn) {
  MemoryBudget budget(1 << 20);
  TenantBudgets budgets(&budget, budget.total_bytes());
  MemoryPartialUploads uploads(&budgets, &timers_, absl::Minutes(5));
  uploads.Keep({"b", "b"}, {"x", *uploads.Reserve("b", 1)});
  for (std::size_t i = 0; i < MemoryPartialUploads::kMaxKept; ++i) {
    uploads.Keep({"a", absl::StrCat(i)}, {"x", *uploads.Reserve("a", 1)});
  }
  EXPECT_EQ(uploads.ReceivedBytes("b", {"b"}).front(), 1);
  EXPECT_EQ(uploads.ReceivedBytes("a", {"0"}).front(), 0);
}

TEST_F(PartialUploadsTest, TheirNumberIsBounded) {
  MemoryBudget budget(1 << 20);
  TenantBudgets budgets(&budget, budget.total_bytes());
  MemoryPartialUploads uploads(&budgets, &timers_, absl::Minutes(5));
  for (std::size_t i = 0; i <= MemoryPartialUploads::kMaxKept; ++i) {
    uploads.Keep({kTenant, absl::StrCat(i)},
                 {"x", *uploads.Reserve(kTenant, 1)});
  }
  EXPECT_EQ(budget.reserved_bytes(), MemoryPartialUploads::kMaxKept);
  EXPECT_EQ(uploads.ReceivedBytes(kTenant, {"0"}).front(), 0);
  EXPECT_EQ(uploads.ReceivedBytes(kTenant, {"1"}).front(), 1);
}

TEST_F(PartialUploadsTest, ClearDropsAllAndItsTimers) {
  Keep("a", "1");
  uploads_.Clear();
  EXPECT_EQ(budget_.reserved_bytes(), 0);
  EXPECT_EQ(timers_.live_timers(), 0);
}

TEST_F(PartialUploadsTest, ThreadsShareItWithoutLosingRoom) {
  MemoryBudget budget(10'000);
  std::optional<ThreadPool> timers(1);
  TenantBudgets budgets(&budget, budget.total_bytes());
  MemoryPartialUploads uploads(&budgets, &*timers, absl::Microseconds(50));
  std::atomic<int> damaged = 0;
  std::vector<std::jthread> threads;
  for (unsigned seed = 0; seed < 4; ++seed) {
    threads.emplace_back([&, seed] {
      std::mt19937 random(seed);
      for (int i = 0; i < 2000; ++i) {
        const BlobKey key{kTenant, absl::StrCat(random() % 3)};
        PartialUpload upload = *uploads.Take(key);
        if (upload.bytes != std::string(upload.bytes.size(), key.sha256[0])) {
          ++damaged;
        }
        auto room = uploads.Reserve(kTenant,
                                    static_cast<std::int64_t>(random() % 3000));
        if (!room.ok()) continue;
        upload.bytes.append(static_cast<size_t>(room->bytes()), key.sha256[0]);
        upload.reservation.Merge(*std::move(room));
        uploads.Keep(key, std::move(upload));
      }
    });
  }
  threads.clear();  // joins
  EXPECT_EQ(damaged, 0);
  uploads.Clear();
  // Joins: what expired just now may still be on its way out there.
  timers.reset();
  EXPECT_EQ(budget.reserved_bytes(), 0);
}

}  // namespace
}  // namespace isomatch
