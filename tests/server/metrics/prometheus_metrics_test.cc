#include "server/metrics/prometheus_metrics.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "tests/server/metrics/http_get.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

constexpr char kFreePort[] = "127.0.0.1:0";

TEST(PrometheusMetricsTest, TellsTheLoadOfTheMomentOfTheScrape) {
  PrometheusMetrics metrics("1.2.3");
  LoadFigures load{.queued_low = 1,
                   .queued_normal = 3,
                   .held_for_storage = 5,
                   .held_for_inputs = 1,
                   .running_jobs = 2,
                   .stuck_workers = 1,
                   .watchers = 5,
                   .connections = 6,
                   .refused_connections = 8,
                   .memory_budget_bytes = 4096,
                   .memory_reserved_bytes = 1024,
                   .memory_measured_bytes = 2048,
                   .stored_bytes = 77};
  ASSERT_THAT(metrics.Listen(kFreePort, [&] { return load; }), IsOk());
  EXPECT_THAT(
      HttpGet(metrics.address(), "/metrics"),
      AllOf(StartsWith("HTTP/1.1 200"),
            HasSubstr("# TYPE isomatch_jobs_queued gauge\n"),
            HasSubstr("\nisomatch_jobs_queued{priority=\"low\"} 1\n"),
            HasSubstr("\nisomatch_jobs_queued{priority=\"normal\"} 3\n"),
            HasSubstr("\nisomatch_jobs_queued{priority=\"high\"} 0\n"),
            HasSubstr("\nisomatch_jobs_held{reason=\"storage\"} 5\n"),
            HasSubstr("\nisomatch_jobs_held{reason=\"inputs\"} 1\n"),
            HasSubstr("\nisomatch_jobs_running 2\n"),
            HasSubstr("\nisomatch_workers_stuck 1\n"),
            HasSubstr("\nisomatch_watchers 5\n"),
            HasSubstr("\nisomatch_connections 6\n"),
            HasSubstr("\n# TYPE isomatch_connections_refused_total counter\n"),
            HasSubstr("\nisomatch_connections_refused_total 8\n"),
            HasSubstr("\nisomatch_memory_budget_bytes 4096\n"),
            HasSubstr("\nisomatch_memory_reserved_bytes 1024\n"),
            HasSubstr("\nisomatch_memory_measured_bytes 2048\n"),
            HasSubstr("\nisomatch_stored_bytes 77\n"),
            HasSubstr("\nisomatch_build_info{version=\"1.2.3\"} 1\n")));
  load.queued_normal = 4;
  EXPECT_THAT(HttpGet(metrics.address(), "/metrics"),
              HasSubstr("\nisomatch_jobs_queued{priority=\"normal\"} 4\n"));
}

TEST(PrometheusMetricsTest, CountsWhatHappens) {
  PrometheusMetrics metrics("1");
  metrics.JobStarted(absl::Seconds(3));
  metrics.JobEnded("FAILED", "RUN_TIMEOUT");
  metrics.JobEnded("FAILED", "RUN_TIMEOUT");
  metrics.JobRan("FAILED", absl::Seconds(40));
  metrics.StageRan("zoomout", absl::Seconds(7));
  metrics.JobMeasured(1.1);
  metrics.Uploaded(100);
  metrics.Uploaded(23);
  metrics.CallHandled("s/M", "OK", absl::Milliseconds(3));
  ASSERT_THAT(metrics.Listen(kFreePort, [] { return LoadFigures(); }), IsOk());
  EXPECT_THAT(
      HttpGet(metrics.address(), "/metrics"),
      AllOf(HasSubstr("isomatch_jobs_total{reason=\"RUN_TIMEOUT\",state="
                      "\"FAILED\"} 2\n"),
            HasSubstr("isomatch_queue_wait_seconds_bucket{le=\"2\"} 0\n"),
            HasSubstr("isomatch_queue_wait_seconds_bucket{le=\"5\"} 1\n"),
            HasSubstr("isomatch_queue_wait_seconds_sum 3\n"),
            HasSubstr("isomatch_job_seconds_sum{state=\"FAILED\"} 40\n"),
            HasSubstr("isomatch_run_seconds_sum{stage=\"zoomout\"} 7\n"),
            HasSubstr(
                "isomatch_memory_estimate_error_ratio_bucket{le=\"1\"} 0\n"),
            HasSubstr(
                "isomatch_memory_estimate_error_ratio_bucket{le=\"1.25\"} 1\n"),
            HasSubstr("isomatch_upload_bytes_total 123\n"),
            HasSubstr("isomatch_grpc_server_handled_total{code=\"OK\",method="
                      "\"s/M\"} 1\n"),
            HasSubstr("isomatch_grpc_server_handling_seconds_bucket{method="
                      "\"s/M\",le=\"0.005\"} 1\n")));
}

TEST(PrometheusMetricsTest, TellsOfASharedQueue) {
  PrometheusMetrics metrics("1", /*is_shared=*/true);
  metrics.Claimed(1, absl::Milliseconds(7));
  metrics.Claimed(0, absl::Milliseconds(300));
  metrics.ClaimFailed();
  metrics.LeaseLost();
  for (int i = 0; i < 3; ++i) metrics.LeaseExpired();
  LoadFigures load;
  load.cluster = {.is_database_up = true,
                  .database_errors = 9,
                  .told = ClusterFigures::Told{
                      .queued_jobs = 11,
                      .running_jobs = 12,
                      .oldest_queued = absl::Milliseconds(1500),
                      .workers = 13,
                      .live_rows = 14,
                      .dead_rows = 15,
                      .table_bytes = 16,
                      .oldest_transaction = absl::Milliseconds(2500)}};
  ASSERT_THAT(metrics.Listen(kFreePort, [&] { return load; }), IsOk());
  const std::string text = HttpGet(metrics.address(), "/metrics");
  for (const char* line :
       {"cluster_jobs_queued 11", "cluster_jobs_running 12",
        "queue_oldest_seconds 1.5", "workers_registered 13", "database_up 1",
        "database_live_rows 14", "database_dead_rows 15",
        "database_table_bytes 16", "database_oldest_transaction_seconds 2.5",
        "claims_total 1", "claim_failures_total 1", "leases_lost_total 1",
        "leases_expired_total 3", "database_errors_total 9",
        "claim_seconds_count 2", "claim_seconds_bucket{le=\"0.01\"} 1"}) {
    EXPECT_THAT(text, HasSubstr(absl::StrCat("\nisomatch_", line, "\n")));
  }
  load.cluster->told.reset();
  load.cluster->is_database_up = false;
  EXPECT_THAT(HttpGet(metrics.address(), "/metrics"),
              AllOf(HasSubstr("\nisomatch_database_up 0\n"),
                    HasSubstr("\nisomatch_database_errors_total 9\n"),
                    Not(HasSubstr("isomatch_cluster_jobs_queued")),
                    Not(HasSubstr("isomatch_workers_registered"))));
}

TEST(PrometheusMetricsTest, OnlyMetricsAreServed) {
  PrometheusMetrics metrics("1");
  ASSERT_THAT(metrics.Listen(kFreePort, [] { return LoadFigures(); }), IsOk());
  for (const char* path : {"/", "/etc/passwd", "/../etc/passwd"}) {
    EXPECT_THAT(HttpGet(metrics.address(), path),
                AllOf(StartsWith("HTTP/1.1 404"), Not(HasSubstr("root:"))))
        << path;
  }
}

TEST(PrometheusMetricsTest, APortInUseIsAnError) {
  PrometheusMetrics first("1");
  const auto no_load = [] { return LoadFigures(); };
  ASSERT_THAT(first.Listen(kFreePort, no_load), IsOk());
  PrometheusMetrics second("1");
  EXPECT_THAT(
      second.Listen(first.address(), no_load),
      StatusIs(absl::StatusCode::kUnavailable, HasSubstr(first.address())));
  EXPECT_EQ(second.address(), "");
  first.Close();
  EXPECT_EQ(first.address(), "");
}

TEST(PrometheusMetricsTest, TheNullObjectTakesEverything) {
  Metrics& metrics = NullMetrics();
  metrics.JobEnded("FAILED", "INTERNAL");
  metrics.CallHandled("s/M", "OK", absl::Seconds(1));
}

}  // namespace
}  // namespace isomatch
