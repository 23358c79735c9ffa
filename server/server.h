#pragma once

#include <functional>
#include <memory>
#include <string>

#include <grpcpp/channel.h>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/pipeline/match_engine.h"
#include "server/config/server_config.h"
#include "server/convert/request_limits.h"
#include "server/rpc/connection_table.h"
#include "server/stores.h"

namespace isomatch {

/// A running Isomatch server: stores, worker slots and gRPC endpoint.
///
/// Shutdown order:
///   1. health answers NOT_SERVING, CreateJob answers UNAVAILABLE (DRAINING);
///   2. no job starts any more, running ones get the drain time;
///   3. those that still run are asked to stop, and get unresponsive_grace for
///      it. With a data directory they and
///      the queued ones are QUEUED there and run when the server starts again;
///      without, they become CANCELLED;
///   4. watchers get their last message, or UNAVAILABLE (DRAINING) when the job
///      goes on later; with a drain time, clients get 0.3 s to ask for the
///      results, then gRPC stops;
///   5. the metrics endpoint closes and the threads are joined.
///
/// Thread-safe.
class Server {
 public:
  /// Returns a server that accepts calls and has taken up the jobs of its data
  /// directory. INVALID_ARGUMENT: the configuration; UNAVAILABLE: the address
  /// cannot be listened on; errors of OpenStores.
  static absl::StatusOr<std::unique_ptr<Server>> Create(
      const ServerConfig& config);

  /// Called at most once, from any thread, with the reason: jobs that do not
  /// stop have taken all workers or too much memory, so the process should shut
  /// down without a drain and start again.
  using OnGiveUp = std::function<void(const std::string& reason)>;

  /// The same with another implementation of the method, for tests, and
  /// OnGiveUp; without it the server goes on as well as it can.
  static absl::StatusOr<std::unique_ptr<Server>> Create(
      const ServerConfig& config, MatchEngine engine,
      OnGiveUp on_give_up = nullptr);

  /// The same with stores that `open` opens: of a database, which programs that
  /// never need one are not linked with.
  static absl::StatusOr<std::unique_ptr<Server>> Create(
      const ServerConfig& config, MatchEngine engine, OnGiveUp on_give_up,
      const StoreOpener& open);

  /// Shuts down at once if Shutdown was not called. Does not return before all
  /// workers have, also those that stuck_workers counts.
  ~Server();

  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// HOST:PORT with the port it really has; empty without a port.
  std::string address() const;

  /// HOST:PORT of the metrics; empty without them.
  std::string metrics_address() const;

  /// What isomatch.workers and others of a database know this process as.
  std::string process_name() const;

  /// What running jobs may reserve together.
  std::int64_t memory_budget_bytes() const;

  /// What requests may contain: the configuration's limits, or less where the
  /// memory budget has no room for them.
  const RequestLimits& limits() const;

  /// How many may be connected.
  const ConnectionLimits& connection_limits() const;

  /// Threads each job gets.
  int threads_per_job() const;

  /// Returns a channel within this process, which needs no port. The server
  /// must outlive it.
  std::shared_ptr<grpc::Channel> InProcessChannel();

  /// Jobs that have a worker, without those that are stuck.
  int running_jobs() const;

  /// Workers that did not come back when their jobs were asked to stop.
  int stuck_workers() const;

  /// Steps 1 to 4; running jobs get `drain`, then the configuration's
  /// unresponsive_grace to stop. Calls after the first do nothing.
  void Shutdown(absl::Duration drain);

 private:
  class Impl;
  explicit Server(std::unique_ptr<Impl> impl);

  std::unique_ptr<Impl> impl_;
};

}  // namespace isomatch
