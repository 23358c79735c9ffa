#pragma once

#include <cstdint>
#include <memory>

#include "absl/status/statusor.h"
#include "client/api/isomatch_client.h"
#include "server/server.h"

namespace isomatch {

/// The number of threads that a job can have on this machine; 0 stays 0. Asked
/// for more, TBB would complain.
std::uint32_t ThreadsHere(std::uint32_t threads);

/// Starts the server that commands use when no `--server` was given: in this
/// process, without a port and without files. `workers` >= 1 jobs at a time;
/// `threads` of each, 0 sharing the cores among them. Errors of Server::Create.
absl::StatusOr<std::unique_ptr<Server>> StartEmbeddedServer(
    int workers = 1, std::uint32_t threads = 0);

/// A client of such a server. The server must outlive it.
IsomatchClient ClientOf(Server* server);

}  // namespace isomatch
