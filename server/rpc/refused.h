#pragma once

#include "absl/status/status.h"
#include "server/rpc/grpc_status.h"

namespace isomatch {

/// A stream that could not begin: ends with `status` and deletes itself. No
/// message of the client is read.
template <typename Reactor>
class Refused final : public Reactor {
 public:
  explicit Refused(const absl::Status& status) { this->Finish(ToGrpc(status)); }
  void OnDone() override { delete this; }
};

}  // namespace isomatch
