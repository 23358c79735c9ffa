#include "server/config/resource_plan.h"

#include <gtest/gtest.h>

namespace isomatch {
namespace {

constexpr std::int64_t kGibibyte = std::int64_t{1} << 30;

/// With 8 GiB.
ResourcePlan Plan(const ServerConfig& config) {
  return PlanResources(
      config, {.memory_bytes = 8 * kGibibyte, .cores = 4, .files = 1 << 20});
}

std::int64_t BudgetWithin(std::int64_t available_bytes, std::int64_t wanted) {
  ServerConfig config;
  config.memory_budget_bytes = wanted;
  const ResourcePlan plan =
      PlanResources(config, {.memory_bytes = available_bytes});
  return plan.job_bytes + plan.prepared_bytes;
}

TEST(ResourcePlanTest, TheBudgetIsNeverMoreThanFourFifths) {
  EXPECT_EQ(BudgetWithin(1000, 0), 800);
  EXPECT_EQ(BudgetWithin(1000, 500), 500);
  EXPECT_EQ(BudgetWithin(1000, 900), 800);
}

TEST(ResourcePlanTest, PreparedMeshesHaveAtMostAQuarterOfTheBudget) {
  ServerConfig config;
  config.memory_budget_bytes = 4 * kGibibyte;
  EXPECT_EQ(Plan(config).prepared_bytes, config.prepared_cache_bytes);
  config.prepared_cache_bytes = 2 * kGibibyte;
  EXPECT_EQ(Plan(config).prepared_bytes, kGibibyte);
  EXPECT_EQ(Plan(config).job_bytes, 3 * kGibibyte);
}

TEST(ResourcePlanTest, WorkersShareTheCores) {
  ServerConfig config;
  for (const auto& [workers, threads] :
       {std::pair(1, 4), std::pair(2, 2), std::pair(8, 1)}) {
    config.workers = workers;
    EXPECT_EQ(Plan(config).threads_per_job, threads);
  }
  config.threads_per_job = 3;
  EXPECT_EQ(Plan(config).threads_per_job, 3);
}

TEST(ResourcePlanTest, LessIsResidentThanTheMachineHas) {
  ServerConfig config;
  config.memory_budget_bytes = kGibibyte;
  config.blob_store_bytes = kGibibyte;
  // The budget, a quarter of it, 512 MiB for gRPC, and blobs.
  EXPECT_EQ(Plan(config).max_resident_bytes, kGibibyte / 4 * 11);
  config.data_dir = "data";
  EXPECT_EQ(Plan(config).max_resident_bytes, kGibibyte / 4 * 7);
  config.memory_budget_bytes = 0;
  EXPECT_EQ(Plan(config).max_resident_bytes,
            static_cast<std::int64_t>(0.95 * 8 * kGibibyte));
  config.max_resident_bytes = 1;
  EXPECT_EQ(Plan(config).max_resident_bytes, 1);
}

TEST(ResourcePlanTest, WithoutKeysThereIsOneTenantThatHasAll) {
  ServerConfig config;
  config.workers = 8;
  const ResourcePlan plan = Plan(config);
  const TenantLimits& limits = plan.tenant;
  EXPECT_EQ(limits.queued_jobs, config.max_queued_jobs);
  EXPECT_GE(limits.running_jobs, config.workers);
  EXPECT_EQ(limits.kept_jobs, config.max_kept_jobs);
  EXPECT_EQ(limits.stored_bytes, 0);
  EXPECT_EQ(limits.upload_bytes, plan.upload_bytes);
  EXPECT_EQ(limits.request_bytes, plan.request_bytes);
  EXPECT_EQ(limits.uploads, TenantLimits::kNone);
  EXPECT_EQ(limits.requests, TenantLimits::kNone);
  EXPECT_EQ(plan.intake_threads, 1);
}

TEST(ResourcePlanTest, WithKeysEachHasAShare) {
  ServerConfig config;
  config.api_keys = "keys";
  for (const auto& [workers, running] :
       {std::pair(1, 1), std::pair(2, 2), std::pair(3, 3), std::pair(4, 3),
        std::pair(8, 6)}) {
    config.workers = workers;
    EXPECT_EQ(Plan(config).tenant.running_jobs, running);
  }
  const ResourcePlan plan = Plan(config);
  const TenantLimits& limits = plan.tenant;
  EXPECT_EQ(limits.queued_jobs, 50);
  EXPECT_EQ(limits.kept_jobs, 500);
  EXPECT_EQ(limits.upload_bytes, (plan.upload_bytes + 1) / 2);
  EXPECT_LE(plan.requests.max_mesh_bytes, limits.upload_bytes);
  EXPECT_LE(plan.requests.max_request_bytes, limits.request_bytes);
  EXPECT_GE(limits.stored_bytes,
            2 * config.max_mesh_bytes + config.max_request_bytes);
  EXPECT_EQ(plan.intake_threads, 2);
}

TEST(ResourcePlanTest, ProcessesOfAStoreLimitNobodyToWhatOneOfThemRuns) {
  ServerConfig config;
  config.store = "postgresql://isomatch@db/isomatch";
  EXPECT_EQ(Plan(config).tenant.running_jobs, TenantLimits::kNone);
  config.api_keys = "keys";
  EXPECT_EQ(Plan(config).tenant.running_jobs, TenantLimits::kNone);
  config.max_running_jobs_per_tenant = 3;
  EXPECT_EQ(Plan(config).tenant.running_jobs, 3);
}

TEST(ResourcePlanTest, WhatIsSaidHolds) {
  ServerConfig config;
  config.api_keys = "keys";
  config.max_queued_jobs_per_tenant = 100;
  config.max_running_jobs_per_tenant = 1;
  config.max_kept_jobs_per_tenant = 3;
  config.max_uploads_per_tenant = 4;
  config.max_requests_per_tenant = 5;
  config.max_bytes_per_tenant = std::int64_t{600} << 20;
  const TenantLimits limits = Plan(config).tenant;
  EXPECT_EQ(limits.queued_jobs, 100);
  EXPECT_EQ(limits.running_jobs, 1);
  EXPECT_EQ(limits.kept_jobs, 3);
  EXPECT_EQ(limits.uploads, 4);
  EXPECT_EQ(limits.requests, 5);
  EXPECT_EQ(limits.stored_bytes, std::int64_t{600} << 20);
}

TEST(ResourcePlanTest, WhatIsHeldBesideTheBudgetLeavesAPartToTheProcess) {
  for (const char* keys : {"", "keys"}) {
    ServerConfig config;
    config.api_keys = keys;
    config.blob_store_bytes = std::int64_t{1} << 50;
    const ResourcePlan plan = Plan(config);
    EXPECT_LE(plan.request_bytes + plan.upload_bytes + plan.download_bytes +
                  plan.intake_threads * plan.requests.max_reading_bytes,
              (plan.job_bytes + plan.prepared_bytes) / 64 * 15 + 64);
  }
}

ConnectionLimits Connections(int most, int of_one_address, std::int64_t files,
                             bool behind_edge = false) {
  ServerConfig config;
  config.max_connections = most;
  config.max_connections_per_address = of_one_address;
  config.behind_edge = behind_edge;
  return PlanResources(config, {.files = files}).connections;
}

TEST(ResourcePlanTest, ConnectionsLeaveAQuarterOfFewFilesAnd1024OfMany) {
  EXPECT_EQ(Connections(0, 0, 256).most, 192);
  EXPECT_EQ(Connections(0, 0, 1024).most, 768);
  EXPECT_EQ(Connections(0, 0, 1 << 20).most, 10'000);
  EXPECT_EQ(Connections(1'000'000, 0, 1 << 20).most, 1'000'000);
  EXPECT_EQ(Connections(1'000'000, 0, 20'000).most, 18'976);
  EXPECT_EQ(Connections(50, 0, 1024).most, 50);
  EXPECT_EQ(Connections(0, 0, 1).most, 1);
}

TEST(ResourcePlanTest, OneAddressGetsAnEighthOfTheConnections) {
  EXPECT_EQ(Connections(0, 0, 1 << 20).of_one_address, 1250);
  EXPECT_EQ(Connections(2, 0, 1 << 20).of_one_address, 1);
  EXPECT_EQ(Connections(0, 7, 1 << 20).of_one_address, 7);
  EXPECT_EQ(Connections(0, 7, 1 << 20, true).of_one_address, 0);
}

}  // namespace
}  // namespace isomatch
