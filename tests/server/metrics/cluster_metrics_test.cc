// Servers that share a PostgreSQL, as Prometheus and Kubernetes see them.

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pqxx/pqxx>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "server/shared_stores.h"
#include "tests/server/metrics/http_get.h"
#include "tests/server/test_server.h"
#include "tests/support/matchers.h"
#include "tests/support/postgres_server.h"

namespace isomatch {
namespace {

using testing::AllOf;
using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

std::unique_ptr<PostgresServer> StartPostgres() {
  auto server = PostgresServer::Start();
  EXPECT_THAT(server, IsOk());
  return server.ok() ? *std::move(server) : nullptr;
}

class ClusterMetricsTest : public TestServer {
 protected:
  ClusterMetricsTest() : database_(StartPostgres()) {
    EXPECT_THAT(MigrateStore(Config()), IsOk());
    server_ = StartServer();
    Connect();
  }

  void Connect() {
    channel_ = grpc::CreateChannel(server_->address(),
                                   grpc::InsecureChannelCredentials());
    stub_ = v1::CorrespondenceService::NewStub(channel_);
  }

  ServerConfig Config() const {
    ServerConfig config = TestConfig();
    config.store = database_->url();
    config.metrics_listen = "127.0.0.1:0";
    config.lease = absl::Seconds(2);
    config.max_run_time = absl::Minutes(5);
    return config;
  }

  std::unique_ptr<Server> StartServer() {
    auto created =
        Server::Create(Config(), GatedEngine(), nullptr, OpenAnyStores);
    EXPECT_THAT(created, IsOk());
    return *std::move(created);
  }

  std::string Ask(const std::string& path) const {
    return HttpGet(server_->metrics_address(), path);
  }

  /// Returns the value of a metric without labels.
  std::optional<double> Value(const std::string& name) const {
    const std::string text = Ask("/metrics");
    const std::string line = absl::StrCat("\nisomatch_", name, " ");
    const size_t begin = text.find(line);
    if (begin == std::string::npos) return std::nullopt;
    const size_t value = begin + line.size();
    double number = 0;
    EXPECT_TRUE(absl::SimpleAtod(
        text.substr(value, text.find('\n', value) - value), &number));
    return number;
  }

  /// Waits until it is; the test's timeout ends it.
  void WaitForValue(const std::string& name, double value) const {
    while (Value(name) != value) absl::SleepFor(absl::Milliseconds(20));
  }
  void WaitUntilReady(bool is_ready) const {
    const std::string begin = is_ready ? "HTTP/1.1 200" : "HTTP/1.1 503";
    while (!absl::StartsWith(Ask("/readyz"), begin)) {
      absl::SleepFor(absl::Milliseconds(20));
    }
  }

  void Do(const std::string& sql) const {
    pqxx::connection connection(database_->url());
    pqxx::work work(connection);
    work.exec(sql);
    work.commit();
  }

  const std::unique_ptr<PostgresServer> database_;
};

TEST_F(ClusterMetricsTest, AJobOfTheClusterIsSeen) {
  gate_open_ = false;
  const std::string running = CreateJob();
  WaitForMatches(1);
  const std::string queued = CreateJob();  // the only worker is taken
  WaitForValue("cluster_jobs_queued", 1);
  EXPECT_EQ(Value("cluster_jobs_running"), 1);
  EXPECT_GT(*Value("queue_oldest_seconds"), 0);
  EXPECT_EQ(Value("workers_registered"), 1);
  EXPECT_EQ(Value("database_up"), 1);
  EXPECT_EQ(Value("database_errors_total"), 0);
  EXPECT_GT(*Value("database_table_bytes"), 0);
  for (const char* name : {"database_live_rows", "database_dead_rows",
                           "database_oldest_transaction_seconds"}) {
    EXPECT_TRUE(Value(name)) << name;
  }
  EXPECT_EQ(Value("claims_total"), 1);
  EXPECT_GE(*Value("claim_seconds_count"), 1);
  EXPECT_THAT(Ask("/metrics"),
              AllOf(HasSubstr("\n# TYPE isomatch_claims_total counter\n"),
                    HasSubstr("isomatch_jobs_queued{priority=\"normal\"} 1\n"),
                    HasSubstr("isomatch_jobs_running 1\n")));
  EXPECT_NE(Value("stored_bytes"), 0);
  gate_open_ = true;
  Watch(queued);
  EXPECT_EQ(Value("claims_total"), 2);
  EXPECT_EQ(Value("claim_failures_total"), 0);
  EXPECT_EQ(Value("leases_lost_total"), 0);
  EXPECT_EQ(Value("leases_expired_total"), 0);
}

TEST_F(ClusterMetricsTest, NobodyWaitsForADatabaseThatDoesNotAnswer) {
  WaitUntilReady(true);
  pqxx::connection connection(database_->url());
  pqxx::work locks(connection);
  locks.exec(
      "LOCK TABLE isomatch.chores, isomatch.live_jobs, isomatch.workers, "
      "isomatch.migrations, isomatch.blob_totals IN ACCESS EXCLUSIVE MODE");
  const absl::Time begin = absl::Now();
  WaitUntilReady(false);
  EXPECT_LT(absl::Now() - begin, absl::Seconds(10));
  EXPECT_THAT(Ask("/readyz"), HasSubstr("database: "));
  // Longer than the watchdog may hang.
  while (absl::Now() - begin < absl::Seconds(16)) {
    const absl::Time asked = absl::Now();
    EXPECT_EQ(Value("database_up"), 0);
    EXPECT_THAT(Ask("/healthz"), StartsWith("HTTP/1.1 200"));
    EXPECT_LT(absl::Now() - asked, absl::Seconds(1));
    absl::SleepFor(absl::Milliseconds(200));
  }
  EXPECT_FALSE(Value("cluster_jobs_queued"));  // that was long ago
  locks.abort();
  WaitUntilReady(true);
  WaitForValue("database_up", 1);
  WaitForValue("cluster_jobs_queued", 0);
}

TEST_F(ClusterMetricsTest, ADatabaseThatIsGoneIsCounted) {
  WaitUntilReady(true);
  database_->Kill();
  WaitUntilReady(false);
  EXPECT_EQ(Value("database_up"), 0);
  EXPECT_GT(*Value("database_errors_total"), 0);
  while (Value("claim_failures_total") == 0) {
    absl::SleepFor(absl::Milliseconds(20));
  }
  EXPECT_THAT(Ask("/healthz"), StartsWith("HTTP/1.1 200"));
  ASSERT_THAT(database_->Restart(), IsOk());
  WaitUntilReady(true);
  EXPECT_EQ(Value("database_up"), 1);
}

TEST_F(ClusterMetricsTest, TablesThatAreTooNewAreNoReadiness) {
  WaitUntilReady(true);
  Do("INSERT INTO isomatch.migrations (number, name, oldest_program) "
     "VALUES (999, 'later', 999)");
  WaitUntilReady(false);
  EXPECT_THAT(Ask("/readyz"), HasSubstr("a newer isomatch-server"));
  EXPECT_EQ(Value("database_up"), 1);
  // Nor may it take jobs.
  CreateJob();
  absl::SleepFor(absl::Seconds(1));
  EXPECT_EQ(Value("claims_total"), 0);
  Do("DELETE FROM isomatch.migrations WHERE number = 999");
  WaitUntilReady(true);
  WaitForValue("claims_total", 1);
}

TEST_F(ClusterMetricsTest, WhoIsRefusedWhatItHasToDoIsNotReady) {
  for (const std::string function :
       {"claim_job(text, bigint, bigint, interval, int, int, int, int, text[])",
        "keep_watched(text[], interval)"}) {
    const bool is_needed = function[0] == 'c';
    WaitUntilReady(true);
    Do("ALTER FUNCTION isomatch." + function + " RENAME TO gone");
    if (is_needed) {
      WaitUntilReady(false);
      EXPECT_THAT(Ask("/readyz"), HasSubstr("claim_job"));
    } else {
      absl::SleepFor(absl::Seconds(1));
      EXPECT_THAT(Ask("/readyz"), StartsWith("HTTP/1.1 200"));
    }
    EXPECT_EQ(Value("database_up"), 1);  // it answers
    Do("ALTER FUNCTION isomatch.gone RENAME TO " +
       function.substr(0, function.find('(')));
  }
  WaitUntilReady(true);
}

TEST_F(ClusterMetricsTest, AJobThatOthersTookIsALostLease) {
  gate_open_ = false;
  CreateJob();
  WaitForMatches(1);
  // As another worker's claim after the lease ran out.
  Do("UPDATE isomatch.live_jobs SET claim = 1000000, worker = 'other', "
     "lease_until = now() + interval '1 hour'");
  WaitForValue("leases_lost_total", 1);
  absl::SleepFor(absl::Seconds(1.5));  // it is told again and again
  EXPECT_EQ(Value("leases_lost_total"), 1);
}

TEST_F(ClusterMetricsTest, ACancelledJobIsNoLostLease) {
  gate_open_ = false;
  const std::string name = CreateJob();
  WaitForMatches(1);
  const auto other = StartServer();
  const auto stub =
      v1::CorrespondenceService::NewStub(other->InProcessChannel());
  grpc::ClientContext context;
  v1::CancelJobRequest request;
  request.set_name(name);
  v1::CancelJobResponse response;
  EXPECT_TRUE(stub->CancelJob(&context, request, &response).ok());
  WaitForValue("jobs_running", 0);
  EXPECT_EQ(Value("leases_lost_total"), 0);
}

TEST_F(ClusterMetricsTest, ADeadWorkersLeaseExpires) {
  gate_open_ = false;
  CreateJob();
  WaitForMatches(1);
  // Nobody renews it any more. The database must have run for a lease.
  Do("UPDATE isomatch.live_jobs SET claim = 1000000, worker = 'dead', "
     "lease_until = now() - interval '1 hour'");
  WaitForValue("leases_expired_total", 1);
}

TEST_F(ClusterMetricsTest, OneThatDrainsIsNotReady) {
  WaitUntilReady(true);
  server_->Shutdown(absl::ZeroDuration());
  EXPECT_THAT(Ask("/readyz"), AllOf(StartsWith("HTTP/1.1 503"),
                                    EndsWith("\r\n\r\ndraining\n")));
  EXPECT_THAT(Ask("/healthz"), StartsWith("HTTP/1.1 200"));
}

TEST_F(ClusterMetricsTest, WithoutASharedDatabaseThereIsNothingOfAll) {
  ServerConfig config = TestConfig();
  config.metrics_listen = "127.0.0.1:0";
  Restart(config);
  EXPECT_THAT(
      Ask("/metrics"),
      AllOf(Not(HasSubstr("isomatch_cluster_")),
            Not(HasSubstr("isomatch_database_")),
            Not(HasSubstr("isomatch_claim")), Not(HasSubstr("isomatch_lease")),
            Not(HasSubstr("isomatch_queue_oldest")),
            Not(HasSubstr("isomatch_workers_registered"))));
  EXPECT_THAT(Ask("/healthz"), EndsWith("\r\n\r\nok\n"));
  EXPECT_THAT(Ask("/readyz"), EndsWith("\r\n\r\nready\n"));
  server_->Shutdown(absl::ZeroDuration());
  EXPECT_THAT(Ask("/readyz"), AllOf(StartsWith("HTTP/1.1 503"),
                                    EndsWith("\r\n\r\ndraining\n")));
}

}  // namespace
}  // namespace isomatch
