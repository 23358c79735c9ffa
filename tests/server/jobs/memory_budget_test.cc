#include "server/jobs/memory_budget.h"

#include <atomic>
#include <cstdint>
#include <random>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/jobs/errors.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::_;

TEST(MemoryBudgetTest, WhatDoesNotFitNowFitsWhenOthersHaveGone) {
  MemoryBudget budget(100);
  auto first = budget.Reserve(60);
  ASSERT_THAT(first, IsOk());
  EXPECT_THAT(budget.Reserve(41),
              StatusIs(absl::StatusCode::kResourceExhausted, _));
  *first = MemoryBudget::Reservation();
  EXPECT_THAT(budget.Reserve(41), IsOk());
}

TEST(MemoryBudgetTest, WhatCanNeverFitIsRefusedForGood) {
  MemoryBudget budget(100);
  const auto refused = budget.Reserve(101);
  EXPECT_THAT(refused, StatusIs(absl::StatusCode::kFailedPrecondition, _));
  EXPECT_EQ(DetailsOf(refused.status()).reason,
            "JOB_NEEDS_MORE_MEMORY_THAN_BUDGET");
}

TEST(MemoryBudgetTest, AReservationShrinksAndTakesOverOthers) {
  MemoryBudget budget(100);
  {
    auto first = budget.Reserve(60);
    ASSERT_THAT(first, IsOk());
    first->ShrinkTo(70);
    EXPECT_EQ(budget.reserved_bytes(), 60);
    first->ShrinkTo(20);
    EXPECT_EQ(budget.reserved_bytes(), 20);
    first->Merge(*budget.Reserve(80));
    EXPECT_EQ(first->bytes(), 100);
    EXPECT_EQ(budget.reserved_bytes(), 100);
    MemoryBudget::Reservation none;
    none.Merge(*std::move(first));
    EXPECT_EQ(none.bytes(), 100);
    EXPECT_EQ(budget.reserved_bytes(), 100);
  }
  EXPECT_EQ(budget.reserved_bytes(), 0);
}

TEST(MemoryBudgetTest, TheWholeBudgetCanBeReserved) {
  MemoryBudget budget(100);
  EXPECT_THAT(budget.Reserve(100), IsOk());
}

TEST(MemoryBudgetTest, AMovedReservationGivesBackOnce) {
  MemoryBudget budget(100);
  {
    MemoryBudget::Reservation moved = *budget.Reserve(30);
    MemoryBudget::Reservation again = std::move(moved);
    EXPECT_EQ(again.bytes(), 30);
    EXPECT_EQ(budget.reserved_bytes(), 30);
  }
  EXPECT_EQ(budget.reserved_bytes(), 0);
}

TEST(MemoryBudgetTest, TheSumOfReservationsIsWhatIsReserved) {
  MemoryBudget budget(1000);
  std::mt19937 random(3);
  std::vector<MemoryBudget::Reservation> held;
  std::int64_t sum = 0;
  for (int step = 0; step < 5000; ++step) {
    SCOPED_TRACE(step);
    if (random() % 2 == 0 && !held.empty()) {
      sum -= held.back().bytes();
      held.pop_back();
    } else {
      const std::int64_t wanted = random() % 400;
      auto reservation = budget.Reserve(wanted);
      ASSERT_EQ(reservation.ok(), sum + wanted <= 1000);
      if (!reservation.ok()) continue;
      sum += wanted;
      held.push_back(*std::move(reservation));
    }
    ASSERT_EQ(budget.reserved_bytes(), sum);
  }
}

TEST(MemoryBudgetTest, ThreadsNeverReserveMoreThanThereIs) {
  MemoryBudget budget(100);
  std::atomic<bool> exceeded = false;
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < 20000; ++i) {
        const auto reservation = budget.Reserve(40);
        if (budget.reserved_bytes() > 100) exceeded = true;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_FALSE(exceeded);
  EXPECT_EQ(budget.reserved_bytes(), 0);
}

TEST(MemoryBudgetTest, APartIsReservedOfTheWholeToo) {
  MemoryBudget whole(100);
  MemoryBudget a(60, &whole);
  MemoryBudget b(60, &whole);
  auto first = a.Reserve(50);
  ASSERT_THAT(first, IsOk());
  EXPECT_THAT(a.Reserve(20), StatusIs(absl::StatusCode::kResourceExhausted, _));
  EXPECT_THAT(b.Reserve(55), StatusIs(absl::StatusCode::kResourceExhausted, _));
  EXPECT_EQ(b.reserved_bytes(), 0);  // what the whole refused was given back
  auto second = b.Reserve(40);
  ASSERT_THAT(second, IsOk());
  EXPECT_EQ(whole.reserved_bytes(), 90);
  first->ShrinkTo(10);
  EXPECT_EQ(whole.reserved_bytes(), 50);
  *second = MemoryBudget::Reservation();
  EXPECT_EQ(b.reserved_bytes(), 0);
  EXPECT_EQ(whole.reserved_bytes(), 10);
}

}  // namespace
}  // namespace isomatch
