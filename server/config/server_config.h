#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "server/config/config_values.h"

namespace isomatch {

/// How a server is set up. The defaults suit one machine that the user owns.
/// server_flags.cc says which flag sets which field.
struct ServerConfig {
  // Where it listens.

  /// HOST:PORT or unix:PATH; port 0 picks a free one. Empty: no port at all,
  /// the server is reached by Server::InProcessChannel only.
  std::string listen = "127.0.0.1:7443";
  /// Allows a `listen` that other machines can reach without TLS or API keys.
  bool insecure = false;
  /// Whether a proxy that stops floods of HTTP/2 stands in front of `listen`:
  /// there is no limit per address then, as all connections are the proxy's.
  bool behind_edge = false;
  /// HOST:PORT of the metrics, IPv4; "off" for none. A server that is no
  /// service has none either.
  std::string metrics_listen = "127.0.0.1:7444";
  /// Allows a `metrics_listen` that other machines can reach; `insecure` does,
  /// too.
  bool insecure_metrics = false;
  /// Whether gRPC's reflection tells who asks about services and messages.
  bool no_reflection = false;

  // Who may call; paths of files, none when empty.

  /// PEM: the certificate chain, and its key. Both or none; with them the port,
  /// if there is one, speaks TLS.
  std::string tls_cert;
  std::string tls_key;
  /// PEM: clients must show a certificate of one of these authorities.
  std::string tls_client_ca;
  /// Lines `name tenant role sha256`; every call must come with one of these
  /// keys. Without them everybody is the default Caller.
  std::string api_keys;

  // Whom it works with.

  /// postgresql://... of the database that several processes share as queue and
  /// store; empty for one process with a folder of its own.
  std::string store;
  /// File whose first line is the database's password; none when empty.
  std::string store_password_file;
  /// With `store`: folder that all processes share, for the content of blobs;
  /// empty for the database. `blob_dir_read_only`: not that of new ones.
  std::string blob_dir;
  bool blob_dir_read_only = false;
  bool is_shared() const { return !store.empty(); }
  /// With `store`: "gateway" takes calls, "worker" runs jobs, "all" does both.
  std::string role = "all";
  bool runs_jobs() const { return role != "gateway"; }
  /// With `store`: how long a process that says nothing is believed to go on
  /// with its jobs.
  static constexpr DurationRange kLease = {absl::Seconds(2), absl::Hours(1)};
  absl::Duration lease = absl::Seconds(15);

  // What it may use.

  /// Jobs that run at the same time.
  static constexpr IntRange kWorkers = {1, 256};
  int workers = 1;
  /// Threads of one job; 0 shares the cores among the workers.
  static constexpr IntRange kThreadsPerJob = {0, 1024};
  int threads_per_job = 0;
  /// Bytes that running jobs may reserve together. 0 stands for 80 % of what
  /// the machine or its cgroup has; more than that is cut down to it.
  static constexpr IntRange kMemoryBudgetBytes = {0, std::int64_t{1} << 50};
  std::int64_t memory_budget_bytes = 0;
  /// What the process may have resident. Beyond it jobs that make no progress
  /// are stopped, and the process ends when they do not: earlier than the
  /// system would end it. 0 stands for the budget and what the server itself
  /// may take, at most 95 % of what the machine or its cgroup has.
  std::int64_t max_resident_bytes = 0;

  // What it keeps.

  /// Folder of jobs, meshes and results, which then outlive the process.
  std::string data_dir;
  /// Everything in memory, as without data_dir.
  bool ephemeral = false;
  bool has_folder() const {
    return !ephemeral && !is_shared() && !data_dir.empty();
  }
  bool is_durable() const { return is_shared() || has_folder(); }
  /// How long a job and its result are kept after it ended.
  static constexpr DurationRange kJobRetention = {absl::Minutes(1),
                                                  absl::Hours(24 * 3652)};
  absl::Duration job_retention = absl::Hours(7 * 24);
  /// Bytes of prepared meshes that are kept in memory, of the memory budget and
  /// at most a quarter of it, and in the data directory; 0 for none.
  static constexpr IntRange kPreparedCacheBytes = {0, std::int64_t{1} << 50};
  std::int64_t prepared_cache_bytes = std::int64_t{256} << 20;
  std::int64_t prepared_store_bytes = std::int64_t{1} << 30;
  /// Bytes of uploaded meshes and results that are kept.
  static constexpr IntRange kBlobStoreBytes = {std::int64_t{16} << 20,
                                               std::int64_t{1} << 50};
  std::int64_t blob_store_bytes = std::int64_t{1} << 30;

  // What it accepts.

  /// Jobs that may wait.
  static constexpr IntRange kMaxQueuedJobs = {1, 100'000};
  int max_queued_jobs = 100;
  // What one tenant may have. 0 stands for no limit of its own, or, when there
  // are API keys, for the share that ResourcePlan gives.

  static constexpr IntRange kPerTenant = {0, 1'000'000};
  int max_queued_jobs_per_tenant = 0;
  int max_running_jobs_per_tenant = 0;
  int max_kept_jobs_per_tenant = 0;
  int max_uploads_per_tenant = 0;
  int max_requests_per_tenant = 0;
  /// How far priorities count among tenants, for keys that do not say it.
  static constexpr IntRange kMaxPriority = {0, 100};
  int max_priority = 0;
  /// Bytes of its meshes, requests and results: 0, or room for one job at
  /// least, 2 max_mesh_bytes + max_request_bytes.
  static constexpr IntRange kMaxTenantBytes = {0, std::int64_t{1} << 50};
  std::int64_t max_bytes_per_tenant = 0;
  /// One request message. At most blob_store_bytes / 2.
  static constexpr IntRange kMaxRequestBytes = {std::int64_t{2} << 20,
                                                std::int64_t{1} << 30};
  std::int64_t max_request_bytes = std::int64_t{4} << 20;
  /// One uploaded mesh. At most blob_store_bytes / 2.
  static constexpr IntRange kMaxMeshBytes = {1, std::int64_t{1} << 40};
  std::int64_t max_mesh_bytes = std::int64_t{256} << 20;

  /// Open connections. 0 is 10,000; what the limit of open files has no room
  /// for is cut off; see ResourcePlan.
  static constexpr IntRange kMaxConnections = {0, 1'000'000};
  int max_connections = 0;
  /// Open connections from one address; 0 is an eighth of all that may be open.
  /// Those from this machine have no limit.
  int max_connections_per_address = 0;

  // How long things last.

  /// What a job may run, whatever it asked for; 0 for no limit.
  static constexpr DurationRange kMaxRunTime = {absl::ZeroDuration(),
                                                absl::Hours(24 * 365)};
  absl::Duration max_run_time = absl::Hours(1);
  /// What a match may take to return once it was asked to stop; then its worker
  /// is given up.
  static constexpr DurationRange kUnresponsiveGrace = {absl::Milliseconds(10),
                                                       absl::Hours(1)};
  absl::Duration unresponsive_grace = absl::Seconds(10);

  /// What running jobs get to finish after SIGTERM.
  static constexpr DurationRange kDrainTimeout = {absl::ZeroDuration(),
                                                  absl::Hours(24)};
  absl::Duration drain_timeout = absl::Seconds(30);
  /// Range of the next two, and of unwatched_grace.
  static constexpr DurationRange kStreamTimes = {absl::Milliseconds(10),
                                                 absl::Hours(1)};
  /// A watcher hears from its job at least this often.
  absl::Duration watch_heartbeat = absl::Seconds(10);
  /// An upload that brings less than 1 KiB a second over this time, or too
  /// little to be whole within an hour, is dropped.
  absl::Duration upload_idle_timeout = absl::Seconds(30);
  /// What an upload that broke off has brought is kept for this long, so that
  /// it can go on there.
  static constexpr DurationRange kPartialUploadKept = {absl::Milliseconds(10),
                                                       absl::Hours(24)};
  absl::Duration partial_upload_kept = absl::Minutes(5);
  /// A job that asks to be cancelled when nobody watches it is cancelled after
  /// this long; see DisconnectGuard.
  absl::Duration unwatched_grace = absl::Seconds(10);
  /// Terminal jobs that are remembered; the oldest go first.
  static constexpr IntRange kMaxKeptJobs = {1, 1'000'000};
  int max_kept_jobs = 1000;

  // What it tells. Used by main.cc only: a server that is no service logs
  // nothing.

  /// trace, debug, info, warn, error, critical or off.
  std::string log_level = "info";
  /// text or json; see LogFormat.
  std::string log_format = "text";

  /// INVALID_ARGUMENT naming field, value and allowed range.
  absl::Status Validate() const;

  /// Whether other machines can reach `listen`.
  bool is_exposed() const;

  /// Whether it is a process of its own, which logs and has metrics, and not
  /// within its only client.
  bool is_service() const { return !listen.empty() || role == "worker"; }
};

/// INVALID_ARGUMENT naming the field when `address` is neither HOST:PORT nor
/// unix:PATH.
absl::Status CheckServerAddress(absl::string_view field,
                                const std::string& address);

}  // namespace isomatch
