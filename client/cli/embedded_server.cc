#include "client/cli/embedded_server.h"

#include <algorithm>
#include <cstdint>
#include <thread>

#include "server/config/server_config.h"

namespace isomatch {
namespace {

/// Most bytes of prepared meshes: about 80 of 5,000 vertices, so that a batch
/// prepares the meshes of a usual collection once. There is no folder that
/// could keep them instead.
constexpr std::int64_t kPreparedBytes = std::int64_t{1} << 30;

/// Bytes of meshes and results that each worker has room for at least: those of
/// two pairs of a million vertices.
constexpr std::int64_t kBlobBytesPerWorker = std::int64_t{128} << 20;

}  // namespace

std::uint32_t ThreadsHere(std::uint32_t threads) {
  return std::min(threads, std::max(1u, std::thread::hardware_concurrency()));
}

absl::StatusOr<std::unique_ptr<Server>> StartEmbeddedServer(
    int workers, std::uint32_t threads) {
  ServerConfig config;
  config.listen.clear();
  config.max_run_time = absl::ZeroDuration();  // it is its user's own machine
  config.prepared_cache_bytes = kPreparedBytes;
  config.blob_store_bytes =
      std::max(config.blob_store_bytes, workers * kBlobBytesPerWorker);
  config.workers = workers;
  config.threads_per_job = static_cast<int>(ThreadsHere(threads));
  return Server::Create(config);
}

IsomatchClient ClientOf(Server* server) {
  return IsomatchClient(server->InProcessChannel(), IsomatchClient::kPatience,
                        /*is_local=*/true);
}

}  // namespace isomatch
