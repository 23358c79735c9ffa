#include "client/cli/embedded_server.h"

#include <algorithm>
#include <thread>

#include "server/config/server_config.h"

namespace isomatch {

std::uint32_t ThreadsHere(std::uint32_t threads) {
  return std::min(threads, std::max(1u, std::thread::hardware_concurrency()));
}

absl::StatusOr<std::unique_ptr<Server>> StartEmbeddedServer(
    int workers, std::uint32_t threads) {
  ServerConfig config;
  config.listen.clear();
  config.max_run_time = absl::ZeroDuration();  // it is its user's own machine
  config.workers = workers;
  config.threads_per_job = static_cast<int>(ThreadsHere(threads));
  return Server::Create(config);
}

}  // namespace isomatch
