#include "server/config/server_config.h"

#include <optional>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/config/server_flags.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::MatchesRegex;
using testing::Not;

constexpr auto kInvalid = absl::StatusCode::kInvalidArgument;

TEST(ServerConfigTest, TheDefaultsAreValid) {
  EXPECT_THAT(ServerConfig().Validate(), IsOk());
}

TEST(ServerConfigTest, NamesFieldValueAndRange) {
  ServerConfig config;
  config.workers = 0;
  EXPECT_THAT(config.Validate(),
              StatusIs(kInvalid, HasSubstr("--workers = 0, expected 1 to")));
}

TEST(ServerConfigTest, EveryRangeIsChecked) {
  const std::vector<std::pair<const char*, void (*)(ServerConfig&)>> cases = {
      {"--metrics-listen = 7444, expected HOST:PORT",
       [](auto& c) { c.metrics_listen = "7444"; }},
      {"--metrics-listen = [::1]:7444, expected HOST:PORT of IPv4",
       [](auto& c) { c.metrics_listen = "[::1]:7444"; }},
      {"--threads-per-job = -1, expected 0 to 1024",
       [](auto& c) { c.threads_per_job = -1; }},
      {"--memory-budget = -1, expected 0 to 1024TiB",
       [](auto& c) { c.memory_budget_bytes = -1; }},
      {"--blob-store-bytes = 1MiB, expected 16MiB to 1024TiB",
       [](auto& c) { c.blob_store_bytes = 1 << 20; }},
      {"--blob-dir = /nfs without --store",
       [](auto& c) { c.blob_dir = "/nfs"; }},
      {"--blob-dir-read-only without --blob-dir",
       [](auto& c) { c.blob_dir_read_only = true; }},
      {"--store-password-file = f without --store, expected the database",
       [](auto& c) { c.store_password_file = "f"; }},
      {"--role = worker without --store, expected the database",
       [](auto& c) { c.role = "worker"; }},
      {"--lease = 5s without --store, expected the database",
       [](auto& c) { c.lease = absl::Seconds(5); }},
      {"--lease = 1s, expected 2s to 1h",
       [](auto& c) {
         c.store = "postgresql://db/isomatch";
         c.lease = absl::Seconds(1);
       }},
      {"--ephemeral with --store, expected one of them",
       [](auto& c) {
         c.store = "postgresql://db/isomatch";
         c.ephemeral = true;
       }},
      {"--max-queued-jobs = 0, expected 1 to 100000",
       [](auto& c) { c.max_queued_jobs = 0; }},
      {"--max-connections = -1, expected 0 to 1000000",
       [](auto& c) { c.max_connections = -1; }},
      {"--max-connections-per-address = 1000001, expected 0 to 1000000",
       [](auto& c) { c.max_connections_per_address = 1'000'001; }},
      {"--max-kept-jobs = 0, expected 1 to 1000000",
       [](auto& c) { c.max_kept_jobs = 0; }},
      {"--max-request-bytes = 1MiB, expected 2MiB to 512MiB",
       [](auto& c) { c.max_request_bytes = 1 << 20; }},
      {"--max-mesh-bytes = 600MiB, expected 1 to 512MiB (half of "
       "--blob-store-bytes = 1GiB)",
       [](auto& c) { c.max_mesh_bytes = 600 << 20; }},
      {"--max-queued-jobs-per-tenant = -1, expected 0 to 100000",
       [](auto& c) { c.max_queued_jobs_per_tenant = -1; }},
      {"--max-bytes-per-tenant = -1, expected 516MiB to ",
       [](auto& c) { c.max_bytes_per_tenant = -1; }},
      {"--max-bytes-per-tenant = 515MiB, expected 516MiB to ",
       [](auto& c) { c.max_bytes_per_tenant = 515 << 20; }},
      {"--max-priority = 101, expected 0 to 100",
       [](auto& c) { c.max_priority = 101; }},
      {"--job-retention = 1s, expected 1m to 87648h",
       [](auto& c) { c.job_retention = absl::Seconds(1); }},
      {"--max-run-time = 8761h, expected 0 to 8760h",
       [](auto& c) { c.max_run_time = absl::Hours(8761); }},
      {"--unresponsive-grace = 0, expected 10ms to 1h",
       [](auto& c) { c.unresponsive_grace = absl::ZeroDuration(); }},
      {"--max-resident-bytes = -1, expected 0 to 1024TiB",
       [](auto& c) { c.max_resident_bytes = -1; }},
      {"--drain-timeout = 25h, expected 0 to 24h",
       [](auto& c) { c.drain_timeout = absl::Hours(25); }},
      {"--watch-heartbeat = 1ms, expected 10ms to 1h",
       [](auto& c) { c.watch_heartbeat = absl::Milliseconds(1); }},
      {"--upload-idle-timeout = 2h, expected 10ms to 1h",
       [](auto& c) { c.upload_idle_timeout = absl::Hours(2); }},
      {"--log-level = loud, expected trace, debug",
       [](auto& c) { c.log_level = "loud"; }},
      {"--log-format = xml, expected text, json",
       [](auto& c) { c.log_format = "xml"; }},
  };
  for (const auto& [message, break_it] : cases) {
    ServerConfig config;
    break_it(config);
    EXPECT_THAT(config.Validate(), StatusIs(kInvalid, HasSubstr(message)));
  }
}

TEST(ServerConfigTest, DurationsHaveARange) {
  for (const auto field :
       {&ServerConfig::partial_upload_kept, &ServerConfig::unwatched_grace}) {
    ServerConfig config;
    for (const absl::Duration wrong :
         {absl::ZeroDuration(), absl::InfiniteDuration()}) {
      config.*field = wrong;
      EXPECT_THAT(config.Validate(), StatusIs(kInvalid, HasSubstr("10ms")));
    }
  }
}

TEST(ServerConfigTest, ListensBeyondThisMachineOnlyWithTlsAndKeysOrWhenTold) {
  ServerConfig config;
  config.listen = "0.0.0.0:7443";
  EXPECT_THAT(config.Validate(),
              StatusIs(kInvalid, AllOf(HasSubstr("without TLS"),
                                       HasSubstr("without API keys"),
                                       HasSubstr("--insecure"))));
  ServerConfig keys_only = config;
  keys_only.api_keys = "keys.txt";
  EXPECT_THAT(keys_only.Validate(),
              StatusIs(kInvalid, AllOf(HasSubstr("without TLS"),
                                       Not(HasSubstr("without API keys")))));
  ServerConfig tls_only = config;
  tls_only.tls_cert = "server.crt";
  tls_only.tls_key = "server.key";
  tls_only.tls_client_ca = "ca.crt";
  EXPECT_THAT(tls_only.Validate(),
              StatusIs(kInvalid, AllOf(Not(HasSubstr("without TLS")),
                                       HasSubstr("without API keys"))));
  tls_only.api_keys = "keys.txt";
  EXPECT_THAT(tls_only.Validate(), IsOk());
  config.insecure = true;
  EXPECT_THAT(config.Validate(), IsOk());
}

TEST(ServerConfigTest, MetricsLeaveThisMachineOnlyWhenTold) {
  ServerConfig config;
  config.metrics_listen = "0.0.0.0:7444";
  EXPECT_THAT(config.Validate(),
              StatusIs(kInvalid, AllOf(HasSubstr("0.0.0.0:7444 can be read"),
                                       HasSubstr("--insecure-metrics"))));
  ServerConfig all_insecure = config;
  all_insecure.insecure = true;
  EXPECT_THAT(all_insecure.Validate(), IsOk());
  config.insecure_metrics = true;
  EXPECT_THAT(config.Validate(), IsOk());
}

TEST(ServerConfigTest, CertificateAndKeyBelongTogether) {
  ServerConfig config;
  config.tls_cert = "server.crt";
  EXPECT_THAT(config.Validate(),
              StatusIs(kInvalid, HasSubstr("--tls-cert = server.crt without "
                                           "--tls-key, expected")));
  config = ServerConfig();
  config.tls_key = "server.key";
  EXPECT_THAT(config.Validate(),
              StatusIs(kInvalid, HasSubstr("--tls-key = server.key without "
                                           "--tls-cert, expected")));
  config = ServerConfig();
  config.tls_client_ca = "ca.crt";
  EXPECT_THAT(config.Validate(),
              StatusIs(kInvalid, HasSubstr("--tls-client-ca = ca.crt without "
                                           "--tls-cert, expected")));
}

TEST(ServerConfigTest, KnowsLoopbackAddresses) {
  ServerConfig config;
  for (const char* listen :
       {"127.0.0.1:0", "localhost:80", "[::1]:65535", "unix:/tmp/s", ""}) {
    config.listen = listen;
    EXPECT_THAT(config.Validate(), IsOk()) << listen;
  }
  for (const char* listen :
       {"127.0.0.1", ":80", "localhost:65536", "localhost:x", "example.org:80",
        "127.0.0.1.example.org:80", "0.0.0.0:0"}) {
    config.listen = listen;
    EXPECT_FALSE(config.Validate().ok()) << listen;
  }
}

std::optional<int> Parse(std::vector<const char*> flags, ServerConfig& config) {
  flags.insert(flags.begin(), "isomatch-server");
  ServerCommand command{config, std::nullopt};
  const std::optional<int> status =
      ParseServerFlags(static_cast<int>(flags.size()), flags.data(), command);
  config = command.config;
  return status;
}

TEST(ServerFlagsTest, AreReadWithTheirUnits) {
  ServerConfig config;
  EXPECT_EQ(Parse({"--memory-budget", "2GiB", "--drain-timeout", "5m",
                   "--workers", "3", "--max-request-bytes", "8MiB"},
                  config),
            std::nullopt);
  EXPECT_EQ(config.memory_budget_bytes, std::int64_t{2} << 30);
  EXPECT_EQ(config.drain_timeout, absl::Minutes(5));
  EXPECT_EQ(config.workers, 3);
  EXPECT_EQ(config.max_request_bytes, 8 << 20);
}

TEST(ServerFlagsTest, ANumberWithoutUnitIsSeconds) {
  ServerConfig config;
  EXPECT_EQ(Parse({"--max-run-time", "0", "--unresponsive-grace", "3s",
                   "--max-resident-bytes", "1GiB"},
                  config),
            std::nullopt);
  EXPECT_EQ(config.max_run_time, absl::ZeroDuration());
  EXPECT_EQ(config.unresponsive_grace, absl::Seconds(3));
  EXPECT_EQ(config.max_resident_bytes, std::int64_t{1} << 30);
  EXPECT_EQ(Parse({"--drain-timeout", "7"}, config), std::nullopt);
  EXPECT_EQ(config.drain_timeout, absl::Seconds(7));
}

TEST(ServerFlagsTest, FilesOfSecurityAreRead) {
  ServerConfig config;
  EXPECT_EQ(Parse({"--listen", "0.0.0.0:1", "--tls-cert", "a", "--tls-key", "b",
                   "--tls-client-ca", "c", "--api-keys", "d"},
                  config),
            std::nullopt);
  EXPECT_EQ(config.tls_cert, "a");
  EXPECT_EQ(config.tls_key, "b");
  EXPECT_EQ(config.tls_client_ca, "c");
  EXPECT_EQ(config.api_keys, "d");
}

TEST(ServerFlagsTest, ANewKeyGoesToErrorsAndItsLineToOutput) {
  ServerConfig config;
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  EXPECT_EQ(
      Parse({"--new-api-key", "alice", "--tenant", "lab", "--role", "read"},
            config),
      0);
  EXPECT_THAT(testing::internal::GetCapturedStdout(),
              MatchesRegex("alice lab read [0-9a-f]{64}\n"));
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              MatchesRegex("#[^\n]*\nisomatch_[A-Za-z0-9_-]{43}\n"));
}

TEST(ServerFlagsTest, WrongOnesEndWithStatusTwo) {
  for (const std::vector<const char*>& flags :
       std::vector<std::vector<const char*>>{
           {"--wrong"},
           {"--workers", "0"},
           {"--workers", "x"},
           {"--drain-timeout", "soon"},
           {"--log-level", "loud"},
           {"--listen", "0.0.0.0:1"},
           {"--tls-cert", "a"},
           {"--new-api-key", "Al ice"},
           {"--new-api-key", ""},
           {"--tenant", "lab"},
           {"--new-api-key", "a", "--role", "root"}}) {
    ServerConfig config;
    EXPECT_EQ(Parse(flags, config), 2) << flags[0];
  }
}

TEST(ServerFlagsTest, HelpAndVersionEndWithStatusZero) {
  ServerConfig config;
  testing::internal::CaptureStdout();
  EXPECT_EQ(Parse({"--help"}, config), 0);
  EXPECT_THAT(testing::internal::GetCapturedStdout(),
              AllOf(HasSubstr("--listen"), HasSubstr("127.0.0.1:7443"),
                    HasSubstr("Examples")));
  testing::internal::CaptureStdout();
  EXPECT_EQ(Parse({"--version"}, config), 0);
  EXPECT_THAT(testing::internal::GetCapturedStdout(),
              HasSubstr("isomatch-server"));
}

}  // namespace
}  // namespace isomatch
