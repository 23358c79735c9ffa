#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <grpcpp/grpcpp.h>

#include "absl/time/clock.h"
#include "core/base/mutex.h"

namespace isomatch {

/// Unary calls that are all under way at a time, without a thread for each.
template <typename Request, typename Response>
class ManyCalls {
 public:
  /// What starts one: a method of a stub's async().
  using Start =
      std::function<void(grpc::ClientContext*, const Request*, Response*,
                         std::function<void(grpc::Status)>)>;

  explicit ManyCalls(Start start) : start_(std::move(start)) {}
  ~ManyCalls() { WaitFor(calls_.size()); }

  /// Begins a call; by the tenant whose key this is, unless it is empty.
  grpc::ClientContext& Begin(const Request& request,
                             const std::string& key = "") {
    Call& call = *calls_.emplace_back(std::make_unique<Call>());
    call.request = request;
    call.context.set_deadline(
        absl::ToChronoTime(absl::Now() + absl::Minutes(1)));
    if (!key.empty()) call.context.AddMetadata("api-key", key);
    start_(&call.context, &call.request, &call.response,
           [this](grpc::Status status) {
             MutexLock lock(mutex_);
             ended_.push_back(std::move(status));
           });
    return call.context;
  }

  /// Waits until so many have ended; returns how all that have did.
  std::vector<grpc::Status> WaitFor(size_t count) {
    for (;;) {
      {
        MutexLock lock(mutex_);
        if (ended_.size() >= count) return ended_;
      }
      absl::SleepFor(absl::Milliseconds(1));
    }
  }

 private:
  struct Call {
    grpc::ClientContext context;
    Request request;
    Response response;
  };

  const Start start_;
  std::vector<std::unique_ptr<Call>> calls_;
  Mutex mutex_;
  std::vector<grpc::Status> ended_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace isomatch
