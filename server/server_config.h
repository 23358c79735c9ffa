#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"

namespace isomatch {

/// How a server is set up. The defaults suit one machine that the user owns.
struct ServerConfig {
  // Where it listens.

  /// HOST:PORT or unix:PATH; port 0 picks a free one. Empty: no port at all,
  /// the server is reached by Server::InProcessChannel only.
  std::string listen = "127.0.0.1:7443";
  /// Allows a `listen` that other machines can reach without TLS or API keys.
  bool insecure = false;

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

  // What it may use.

  /// Jobs that run at the same time. 1 to 256.
  int workers = 1;
  /// Threads of one job, 0 to 1024; 0 shares the cores among the workers.
  int threads_per_job = 0;
  /// Bytes that running jobs may reserve together. 0 stands for 80 % of what
  /// the machine or its cgroup has; more than that is cut down to it.
  std::int64_t memory_budget_bytes = 0;
  // What it keeps.

  /// Folder of jobs, meshes and results, which then outlive the process. Empty:
  /// they are in memory only.
  std::string data_dir;
  /// Bytes of uploaded meshes and results that are kept. 16 MiB or more.
  std::int64_t blob_store_bytes = std::int64_t{1} << 30;

  // What it accepts.

  /// Jobs that may wait. 1 to 100000.
  int max_queued_jobs = 100;
  /// Of one tenant. 0 for no limit of its own.
  int max_queued_jobs_per_tenant = 0;
  /// One request message. 2 MiB to blob_store_bytes / 2.
  std::int64_t max_request_bytes = std::int64_t{4} << 20;
  /// One uploaded mesh. At most blob_store_bytes / 2.
  std::int64_t max_mesh_bytes = std::int64_t{256} << 20;

  // How long things last.

  /// What running jobs get to finish after SIGTERM. 0 to 24 hours.
  absl::Duration drain_timeout = absl::Seconds(30);
  /// A watcher hears from its job at least this often. 10 ms to 1 hour.
  absl::Duration watch_heartbeat = absl::Seconds(10);
  /// An upload that sends nothing for this long is dropped. 10 ms to 1 hour.
  absl::Duration upload_idle_timeout = absl::Seconds(30);
  /// Terminal jobs that are remembered, 1 or more; the oldest go first.
  int max_kept_jobs = 1000;
  /// How long a job and its result are kept after it ended. 1 minute to 10
  /// years.
  absl::Duration job_retention = absl::Hours(7 * 24);

  /// trace, debug, info, warn, error, critical or off. Used by main.cc only:
  /// a server without a port logs nothing.
  std::string log_level = "info";

  /// INVALID_ARGUMENT naming field, value and allowed range.
  absl::Status Validate() const;
};

}  // namespace isomatch
