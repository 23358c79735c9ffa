#include "server/observation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace isomatch {
namespace {

using testing::HasSubstr;

TEST(HealthTest, AWatchdogThatHangsIsNotWell) {
  EXPECT_TRUE(HealthOf(absl::Milliseconds(300)).is_well);
  EXPECT_TRUE(HealthOf(absl::Seconds(10)).is_well);
  const ProbeAnswer answer = HealthOf(absl::Milliseconds(10'500));
  EXPECT_FALSE(answer.is_well);
  EXPECT_THAT(answer.line, HasSubstr("has not run for 10 s"));
  EXPECT_FALSE(HealthOf(absl::InfiniteDuration()).is_well);
}

TEST(ReadinessTest, TheReasonIsToldTheDrainFirst) {
  const absl::Status away = absl::UnavailableError("database: away");
  EXPECT_TRUE(ReadinessOf(false, absl::OkStatus()).is_well);
  EXPECT_EQ(ReadinessOf(false, absl::OkStatus()).line, "ready");
  EXPECT_FALSE(ReadinessOf(false, away).is_well);
  EXPECT_EQ(ReadinessOf(false, away).line, "database: away");
  EXPECT_FALSE(ReadinessOf(true, away).is_well);
  EXPECT_EQ(ReadinessOf(true, absl::OkStatus()).line, "draining");
}

ClusterView View() {
  ClusterView view;
  view.store_errors = 7;
  view.is_recent = true;
  view.told.emplace();
  view.told->queue.queued = 6;
  view.told->queue.running = 3;
  view.told->queue.queued_by_priority = {{-9, 1}, {0, 2}, {1, 1}, {50, 2}};
  view.told->queue.oldest_queued = absl::Seconds(11);
  view.told->workers = 4;
  view.told->store = {.live_rows = 9,
                      .dead_rows = 100,
                      .table_bytes = 8192,
                      .oldest_transaction = absl::Seconds(2)};
  view.told->stored_bytes = 77;
  return view;
}

TEST(ClusterFiguresTest, AllThatTheDatabaseToldIsThere) {
  LoadFigures figures;
  SetCluster(View(), figures);
  EXPECT_EQ(figures.queued_low, 1);
  EXPECT_EQ(figures.queued_normal, 2);
  EXPECT_EQ(figures.queued_high, 3);
  EXPECT_EQ(figures.stored_bytes, 77);
  ASSERT_TRUE(figures.cluster);
  EXPECT_TRUE(figures.cluster->is_database_up);
  EXPECT_EQ(figures.cluster->database_errors, 7);
  ASSERT_TRUE(figures.cluster->told);
  const ClusterFigures::Told& told = *figures.cluster->told;
  EXPECT_EQ(told.queued_jobs, 6);
  EXPECT_EQ(told.running_jobs, 3);
  EXPECT_EQ(told.oldest_queued, absl::Seconds(11));
  EXPECT_EQ(told.workers, 4);
  EXPECT_EQ(told.live_rows, 9);
  EXPECT_EQ(told.dead_rows, 100);
  EXPECT_EQ(told.table_bytes, 8192);
  EXPECT_EQ(told.oldest_transaction, absl::Seconds(2));
}

TEST(ClusterFiguresTest, WhatIsOldIsNotToldForTheWholeCluster) {
  ClusterView view = View();
  view.store = absl::UnavailableError("database: away");
  view.is_recent = false;
  LoadFigures figures;
  SetCluster(view, figures);
  EXPECT_FALSE(figures.cluster->is_database_up);
  EXPECT_FALSE(figures.cluster->told);
  EXPECT_EQ(figures.queued_normal, 2);  // as it was
}

TEST(ClusterFiguresTest, ADatabaseThatIsTooNewAnswers) {
  ClusterView view = View();
  view.store = absl::FailedPreconditionError("the database has version 9");
  LoadFigures figures;
  SetCluster(view, figures);
  EXPECT_TRUE(figures.cluster->is_database_up);
}

}  // namespace
}  // namespace isomatch
