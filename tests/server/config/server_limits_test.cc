#include "server/config/server_limits.h"

#include <gtest/gtest.h>

namespace isomatch {
namespace {

TEST(ServerLimitsTest, WithoutKeysThereIsOneTenantThatHasAll) {
  ServerConfig config;
  config.workers = 8;
  const TenantLimits limits = TenantLimitsOf(config);
  EXPECT_EQ(limits.queued_jobs, config.max_queued_jobs);
  EXPECT_GE(limits.running_jobs, config.workers);
  EXPECT_EQ(limits.kept_jobs, config.max_kept_jobs);
  EXPECT_EQ(limits.stored_bytes, 0);
  EXPECT_EQ(limits.upload_bytes, UploadBytes(config));
  EXPECT_EQ(limits.request_bytes, RequestBytes(config));
  EXPECT_EQ(limits.uploads, TenantLimits::kNone);
  EXPECT_EQ(limits.requests, TenantLimits::kNone);
  EXPECT_EQ(IntakeThreads(config), 1);
}

TEST(ServerLimitsTest, WithKeysEachHasAShare) {
  ServerConfig config;
  config.api_keys = "keys";
  for (const auto& [workers, running] :
       {std::pair(1, 1), std::pair(2, 2), std::pair(3, 3), std::pair(4, 3),
        std::pair(8, 6)}) {
    config.workers = workers;
    EXPECT_EQ(TenantLimitsOf(config).running_jobs, running);
  }
  const TenantLimits limits = TenantLimitsOf(config);
  EXPECT_EQ(limits.queued_jobs, 50);
  EXPECT_EQ(limits.kept_jobs, 500);
  EXPECT_EQ(limits.upload_bytes, (UploadBytes(config) + 1) / 2);
  EXPECT_LE(MakeRequestLimits(config).max_mesh_bytes, limits.upload_bytes);
  EXPECT_LE(MakeRequestLimits(config).max_request_bytes, limits.request_bytes);
  EXPECT_GE(limits.stored_bytes,
            2 * config.max_mesh_bytes + config.max_request_bytes);
  EXPECT_EQ(IntakeThreads(config), 2);
}

TEST(ServerLimitsTest, WhatIsSaidHolds) {
  ServerConfig config;
  config.api_keys = "keys";
  config.max_queued_jobs_per_tenant = 100;
  config.max_running_jobs_per_tenant = 1;
  config.max_kept_jobs_per_tenant = 3;
  config.max_uploads_per_tenant = 4;
  config.max_requests_per_tenant = 5;
  config.max_bytes_per_tenant = std::int64_t{600} << 20;
  const TenantLimits limits = TenantLimitsOf(config);
  EXPECT_EQ(limits.queued_jobs, 100);
  EXPECT_EQ(limits.running_jobs, 1);
  EXPECT_EQ(limits.kept_jobs, 3);
  EXPECT_EQ(limits.uploads, 4);
  EXPECT_EQ(limits.requests, 5);
  EXPECT_EQ(limits.stored_bytes, std::int64_t{600} << 20);
}

TEST(ServerLimitsTest, WhatIsHeldBesideTheBudgetLeavesAPartToTheProcess) {
  for (const char* keys : {"", "keys"}) {
    ServerConfig config;
    config.api_keys = keys;
    config.blob_store_bytes = std::int64_t{1} << 50;
    EXPECT_LE(RequestBytes(config) + UploadBytes(config) +
                  DownloadBytes(config) +
                  IntakeThreads(config) * ReadingBytes(config),
              ChooseBudgetBytes(config) / 64 * 15 + 64);
  }
}

}  // namespace
}  // namespace isomatch
