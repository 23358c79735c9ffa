// Where the server's configuration comes from: flags, environment, file.

#include "server/config/server_flags.h"

#include <cstdlib>
#include <fstream>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"

namespace isomatch {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

struct Parsed {
  /// Nullopt: the server would start.
  std::optional<int> status;
  ServerCommand command;
  std::string out;
  std::string errors;

  const ServerConfig& config() const { return command.config; }
};

class ServerFlagsSourcesTest : public testing::Test {
 protected:
  ~ServerFlagsSourcesTest() override {
    for (const std::string& name : names_) unsetenv(name.c_str());
  }

  void SetEnvironment(const std::string& name, const std::string& value) {
    setenv(name.c_str(), value.c_str(), /*overwrite=*/1);
    names_.push_back(name);
  }

  /// Returns the path of a file with this text.
  std::string WriteFile(const std::string& text) {
    const auto* const test =
        testing::UnitTest::GetInstance()->current_test_info();
    const std::string path =
        absl::StrCat(testing::TempDir(), "isomatch_", test->name(), ".toml");
    std::ofstream(path) << text;
    return path;
  }

  static Parsed Parse(std::vector<std::string> flags) {
    flags.insert(flags.begin(), "isomatch-server");
    std::vector<const char*> pointers;
    for (const std::string& flag : flags) pointers.push_back(flag.c_str());
    Parsed parsed;
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    parsed.status = ParseServerFlags(static_cast<int>(pointers.size()),
                                     pointers.data(), parsed.command);
    parsed.out = testing::internal::GetCapturedStdout();
    parsed.errors = testing::internal::GetCapturedStderr();
    return parsed;
  }

  /// Checks that the server does not start and says why.
  static void ExpectRefused(const std::vector<std::string>& flags,
                            const std::string& why) {
    const Parsed parsed = Parse(flags);
    EXPECT_EQ(parsed.status, 2) << why;
    EXPECT_THAT(parsed.errors, HasSubstr(why));
  }

 private:
  std::vector<std::string> names_;
};

TEST_F(ServerFlagsSourcesTest, EveryFlagComesFromAFile) {
  const Parsed parsed = Parse(
      {"--config",
       WriteFile("listen = \"unix:/tmp/a b\"\ninsecure = true\n"
                 "metrics-listen = \"off\"\nworkers = 2\nthreads-per-job = 3\n"
                 "memory-budget = \"4GiB\"\nblob-store-bytes = \"5GiB\"\n"
                 "max-queued-jobs = 6\nmax-kept-jobs = 7\n"
                 "max-request-bytes = \"8MiB\"\nmax-mesh-bytes = \"9MiB\"\n"
                 "drain-timeout = \"10s\"\nwatch-heartbeat = \"11s\"\n"
                 "upload-idle-timeout = 12\nlog-level = \"debug\"\n"
                 "log-format = \"json\"\n")});
  ASSERT_EQ(parsed.status, std::nullopt) << parsed.errors;
  const ServerConfig& config = parsed.config();
  EXPECT_EQ(config.listen, "unix:/tmp/a b");
  EXPECT_TRUE(config.insecure);
  EXPECT_EQ(config.metrics_listen, "off");
  EXPECT_EQ(config.workers, 2);
  EXPECT_EQ(config.threads_per_job, 3);
  EXPECT_EQ(config.memory_budget_bytes, std::int64_t{4} << 30);
  EXPECT_EQ(config.blob_store_bytes, std::int64_t{5} << 30);
  EXPECT_EQ(config.max_queued_jobs, 6);
  EXPECT_EQ(config.max_kept_jobs, 7);
  EXPECT_EQ(config.max_request_bytes, 8 << 20);
  EXPECT_EQ(config.max_mesh_bytes, 9 << 20);
  EXPECT_EQ(config.drain_timeout, absl::Seconds(10));
  EXPECT_EQ(config.watch_heartbeat, absl::Seconds(11));
  EXPECT_EQ(config.upload_idle_timeout, absl::Seconds(12));
  EXPECT_EQ(config.log_level, "debug");
  EXPECT_EQ(config.log_format, "json");
}

TEST_F(ServerFlagsSourcesTest, AFlagBeatsTheEnvironmentAndThatTheFile) {
  const std::string file = WriteFile(
      "workers = 2\nmax-queued-jobs = 2\nmax-kept-jobs = 2\n"
      "insecure = true\n");
  SetEnvironment("ISOMATCH_MAX_QUEUED_JOBS", "3");
  SetEnvironment("ISOMATCH_MAX_KEPT_JOBS", "3");
  SetEnvironment("ISOMATCH_INSECURE", "false");
  const Parsed parsed = Parse({"--config", file, "--max-kept-jobs", "4"});
  ASSERT_EQ(parsed.status, std::nullopt) << parsed.errors;
  EXPECT_EQ(parsed.config().threads_per_job, 0);
  EXPECT_EQ(parsed.config().workers, 2);
  EXPECT_EQ(parsed.config().max_queued_jobs, 3);
  EXPECT_EQ(parsed.config().max_kept_jobs, 4);
  EXPECT_FALSE(parsed.config().insecure);
}

TEST_F(ServerFlagsSourcesTest, TheEnvironmentNamesTheFileUnlessAFlagDoes) {
  SetEnvironment("ISOMATCH_CONFIG", WriteFile("workers = 2\n"));
  EXPECT_EQ(Parse({}).config().workers, 2);
  EXPECT_EQ(Parse({"--config", WriteFile("workers = 3\n")}).config().workers,
            3);
}

TEST_F(ServerFlagsSourcesTest, AnEmptyOrForeignVariableIsNothing) {
  SetEnvironment("ISOMATCH_WORKERS", "");
  // As Kubernetes sets for a service of this name.
  SetEnvironment("ISOMATCH_PORT", "tcp://10.0.0.1:7443");
  const Parsed parsed = Parse({"--config", WriteFile("workers = 2\n")});
  EXPECT_EQ(parsed.status, std::nullopt) << parsed.errors;
  EXPECT_EQ(parsed.config().workers, 2);
}

TEST_F(ServerFlagsSourcesTest, ThePrintedConfigurationIsReadBack) {
  const Parsed first =
      Parse({"--print-config", "--workers", "3", "--listen", "unix:/t/a#\"b",
             "--max-mesh-bytes", "12345678", "--drain-timeout", "1m30s",
             "--insecure", "--memory-budget", "2GB"});
  ASSERT_EQ(first.status, 0) << first.errors;
  const std::string file = WriteFile(first.out);
  const Parsed again = Parse({"--config", file, "--print-config"});
  EXPECT_EQ(again.status, 0) << again.errors;
  EXPECT_EQ(again.out, first.out);
  const Parsed started = Parse({"--config", file});
  EXPECT_EQ(started.status, std::nullopt);
  EXPECT_EQ(started.config().listen, "unix:/t/a#\"b");
  EXPECT_EQ(started.config().max_mesh_bytes, 12345678);
  EXPECT_EQ(started.config().memory_budget_bytes, 2'000'000'000);
}

TEST_F(ServerFlagsSourcesTest, ThePrintedConfigurationHasNoPassword) {
  const Parsed parsed =
      Parse({"--print-config", "--store",
             "postgresql://isomatch:secret@db:5433/isomatch?sslmode=require"});
  ASSERT_EQ(parsed.status, 0) << parsed.errors;
  EXPECT_THAT(parsed.out, Not(HasSubstr("secret")));
  EXPECT_THAT(parsed.out, HasSubstr("\nstore = \"postgresql://isomatch@db:5433/"
                                    "isomatch?sslmode=require\"\n"));
  const Parsed again = Parse({"--config", WriteFile(parsed.out)});
  EXPECT_EQ(again.status, std::nullopt) << again.errors;
}

TEST_F(ServerFlagsSourcesTest, AMeshHasRoomInASmallStoreUnlessItIsToBeLarger) {
  const Parsed parsed = Parse({"--blob-store-bytes", "16MiB"});
  ASSERT_EQ(parsed.status, std::nullopt) << parsed.errors;
  EXPECT_EQ(parsed.config().max_mesh_bytes, 8 << 20);
  EXPECT_EQ(Parse({}).config().max_mesh_bytes, ServerConfig().max_mesh_bytes);
  const std::string why =
      "--max-mesh-bytes = 256MiB, expected 1 to 8MiB (half of "
      "--blob-store-bytes = 16MiB)";
  ExpectRefused({"--blob-store-bytes", "16MiB", "--max-mesh-bytes", "256MiB"},
                why);
  SetEnvironment("ISOMATCH_MAX_MESH_BYTES", "256MiB");
  ExpectRefused({"--blob-store-bytes", "16MiB"}, why);
}

TEST_F(ServerFlagsSourcesTest, ADataDirBesideAStoreIsRefusedAsAFlag) {
  const std::string why =
      "--data-dir = d with --store, expected one of them: the database";
  const std::string store = "postgresql://db/isomatch";
  ExpectRefused({"--store", store, "--data-dir", "d"}, why);
  ExpectRefused({"--store", store, "--data-dir=d"}, why);
  // Of a file, as the image's, it is what those without --store have.
  const Parsed parsed =
      Parse({"--store", store, "--config", WriteFile("data-dir = \"d\"\n")});
  EXPECT_EQ(parsed.status, std::nullopt) << parsed.errors;
}

TEST_F(ServerFlagsSourcesTest, ThePrintedConfigurationHasEveryFlag) {
  const std::string printed = Parse({"--print-config"}).out;
  const std::string help = Parse({"--help"}).out;
  size_t flags = 0;
  for (size_t at = 0;
       (at = help.find("Env:ISOMATCH_", at)) != std::string::npos; ++at) {
    ++flags;
  }
  size_t lines = 0;
  for (size_t at = 0; (at = printed.find(" = ", at)) != std::string::npos;
       ++at) {
    ++lines;
  }
  EXPECT_EQ(lines, flags - 1);  // all but --config
}

TEST_F(ServerFlagsSourcesTest, WrongKeysOfAFileAreRefused) {
  ExpectRefused({"--config", WriteFile("workers = 1\nworkerz = 2\n")},
                "--config: line 2: unknown key workerz");
  ExpectRefused({"--config", WriteFile("[network]\n")},
                "line 1: network: expected");
  for (const char* key :
       {"help", "version", "config", "print-config", "health"}) {
    ExpectRefused({"--config", WriteFile(absl::StrCat(key, " = true\n"))},
                  absl::StrCat("unknown key ", key));
  }
}

TEST_F(ServerFlagsSourcesTest, AFileThatIsNotThereIsRefused) {
  ExpectRefused({"--config", "/nowhere/x"}, "--config: /nowhere/x");
  ExpectRefused({"--config", testing::TempDir()}, "--config: ");
  SetEnvironment("ISOMATCH_CONFIG", "/nowhere/y");
  ExpectRefused({}, "--config: /nowhere/y");
}

TEST_F(ServerFlagsSourcesTest, WrongValuesAreRefusedWithFieldValueAndRange) {
  const std::map<std::string, std::string> cases = {
      {"--workers=0", "--workers = 0, expected 1 to 256"},
      {"--workers=many", "--workers = many, expected 1 to 256"},
      {"--workers=99999999999999999999", "expected 1 to 256"},
      {"--memory-budget=lots", "--memory-budget = lots, expected 0 to 1024TiB"},
      {"--blob-store-bytes=1MiB",
       "--blob-store-bytes = 1MiB, expected 16MiB to 1024TiB"},
      {"--drain-timeout=soon", "--drain-timeout = soon, expected 0 to 24h"},
      {"--insecure=maybe", "maybe, expected true or false"},
      {"--log-format=xml", "--log-format = xml, expected text, json"},
      {"--metrics-listen=x", "--metrics-listen = x, expected HOST:PORT"},
      {"--health=x", "--health = x, expected HOST:PORT"},
  };
  for (const auto& [flag, why] : cases) ExpectRefused({flag}, why);
}

TEST_F(ServerFlagsSourcesTest, TheSameHoldsForEnvironmentAndFile) {
  const std::string why = "--workers = 0, expected 1 to 256";
  ExpectRefused({"--config", WriteFile("workers = 0\n")}, why);
  ExpectRefused({"--config", WriteFile("insecure = \"maybe\"\n")},
                "maybe, expected true or false");
  SetEnvironment("ISOMATCH_WORKERS", "0");
  ExpectRefused({}, why);
}

TEST_F(ServerFlagsSourcesTest, HelpOfMigrateHasItsFlagsAndNoOthers) {
  const Parsed parsed = Parse({"migrate", "--help"});
  EXPECT_EQ(parsed.status, 0);
  EXPECT_THAT(parsed.out,
              AllOf(HasSubstr("--store URL (Env:ISOMATCH_STORE)"),
                    HasSubstr("--store-password-file FILE"),
                    HasSubstr("isomatch-server migrate --store postgresql://"),
                    Not(HasSubstr("--workers"))));
}

TEST_F(ServerFlagsSourcesTest, HealthIsThatOfTheConfiguredServer) {
  EXPECT_EQ(Parse({}).command.health_address, std::nullopt);
  EXPECT_EQ(Parse({"--health"}).command.health_address, "127.0.0.1:7443");
  SetEnvironment("ISOMATCH_LISTEN", "0.0.0.0:8443");
  SetEnvironment("ISOMATCH_INSECURE", "true");
  EXPECT_EQ(Parse({"--health"}).command.health_address, "127.0.0.1:8443");
  EXPECT_EQ(Parse({"--health", "unix:/x"}).command.health_address, "unix:/x");
}

TEST_F(ServerFlagsSourcesTest, HealthOfAWorkerIsAskedElsewhere) {
  std::vector<std::string> flags = {"--store",
                                    "postgresql://db/isomatch",
                                    "--role",
                                    "worker",
                                    "--insecure-metrics",
                                    "--metrics-listen",
                                    "0.0.0.0:7555",
                                    "--health"};
  ExpectRefused(flags,
                "--health with --role = worker, which takes no calls; ask "
                "http://127.0.0.1:7555/readyz");
  flags.push_back("unix:/x");
  EXPECT_EQ(Parse(flags).command.health_address, "unix:/x");
  flags[6] = "off";
  flags.pop_back();
  ExpectRefused(flags, "its --metrics-listen, which is off");
}

}  // namespace
}  // namespace isomatch
