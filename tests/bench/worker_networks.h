#pragma once

#include <memory>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace isomatch::bench {

/// Network namespaces of this machine, one for each worker: what a worker sends
/// goes through an Ethernet bridge, as between machines, to this process's own
/// namespace. They are gone with the object. Needs root and `ip` of iproute2.
class WorkerNetworks {
 public:
  /// The address of this process's namespace that all workers reach.
  static constexpr char kAddress[] = "10.213.0.1";
  static constexpr char kNetwork[] = "10.213.0.0/24";

  /// PERMISSION_DENIED; UNAVAILABLE: what `ip` said.
  static absl::StatusOr<std::unique_ptr<WorkerNetworks>> Make(int workers);

  ~WorkerNetworks();

  WorkerNetworks(const WorkerNetworks&) = delete;
  WorkerNetworks& operator=(const WorkerNetworks&) = delete;

  /// From now on the sockets that this thread opens are in that namespace.
  absl::Status Enter(int worker) const;

 private:
  explicit WorkerNetworks(std::string prefix) : prefix_(std::move(prefix)) {}

  std::string NameOf(int worker) const;

  const std::string prefix_;
  int workers_ = 0;
};

}  // namespace isomatch::bench
