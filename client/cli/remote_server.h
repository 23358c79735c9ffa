#pragma once

#include <memory>
#include <string>
#include <utility>

#include <grpcpp/channel.h>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "client/api/isomatch_client.h"
#include "client/cli/connection_flags.h"
#include "client/cli/terminal.h"

namespace isomatch {

/// The server that the flags of a command name.
class RemoteServer {
 public:
  /// Reads the files of the flags, and the environment's ISOMATCH_API_KEY.
  /// Warnings go to terminal.err. Errors as LoadSecurity; nothing is sent yet.
  static absl::StatusOr<RemoteServer> Open(const ConnectionFlags& flags,
                                           const Terminal& terminal);

  /// The same, then asks the server who it is, so that one that is not there is
  /// told within the 3 s of GetServerInfo: later calls wait for longer, as a
  /// server that was there may come back. What Explain says.
  static absl::StatusOr<RemoteServer> Contact(const ConnectionFlags& flags,
                                              const Terminal& terminal);

  /// A client of it that has the patience of the flags.
  IsomatchClient client() const { return IsomatchClient(channel_, patience_); }

  /// Returns what a call ended with, in the words of the flags: which server
  /// did not answer, which flag would have brought the missing key.
  absl::Status Explain(const absl::Status& status) const;

 private:
  RemoteServer(std::string address, std::shared_ptr<grpc::Channel> channel,
               absl::Duration patience)
      : address_(std::move(address)),
        channel_(std::move(channel)),
        patience_(patience) {}

  std::string address_;
  std::shared_ptr<grpc::Channel> channel_;
  absl::Duration patience_;
};

}  // namespace isomatch
