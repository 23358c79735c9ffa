#pragma once

#include <functional>
#include <random>
#include <stop_token>

#include <grpcpp/client_context.h>
#include <grpcpp/support/status.h>

#include "absl/status/status.h"
#include "absl/time/time.h"

namespace isomatch {

/// Pauses between attempts that end with UNAVAILABLE, in all for `patience`
/// from the first failure on; they grow, each up to a fifth longer or shorter,
/// so that clients of a server that comes back do not come together. Not
/// thread-safe.
class Backoff {
 public:
  /// `stop` outlives it and cuts a pause short.
  Backoff(const std::stop_token& stop, absl::Duration patience)
      : stop_(stop), patience_(patience) {}

  /// What happens next is a first failure.
  void Reset();

  /// True after a pause when `status` calls for another attempt.
  bool Again(const absl::Status& status);

 private:
  static constexpr absl::Duration kFirstPause = absl::Milliseconds(100);
  static constexpr absl::Duration kLongestPause = absl::Seconds(2);

  const std::stop_token& stop_;
  const absl::Duration patience_;
  absl::Time give_up_ = absl::InfiniteFuture();
  absl::Duration pause_ = kFirstPause;
  std::minstd_rand jitter_{std::random_device()()};
};

/// A call's context that ends the call when `stop` is requested.
class StoppableContext {
 public:
  explicit StoppableContext(const std::stop_token& stop)
      : cancel_(stop, [this] { context_.TryCancel(); }) {}
  grpc::ClientContext* get() { return &context_; }

 private:
  grpc::ClientContext context_;
  std::stop_callback<std::function<void()>> cancel_;
};

/// CANCELLED, as the user wants it.
absl::Status Stopped();

/// Returns what a call ended with. CANCELLED without the user's wish becomes
/// UNAVAILABLE: a server that stops ends its calls so. So does INTERNAL of a
/// stream that was reset: a proxy that loses the server does that.
absl::Status OfCall(const grpc::Status& status, const std::stop_token& stop);

/// Calls `call(context)` until it ends with anything but UNAVAILABLE, or
/// `patience` is over.
template <typename Call>
absl::Status Retry(const std::stop_token& stop, absl::Duration patience,
                   const Call& call) {
  Backoff backoff(stop, patience);
  absl::Status status;
  do {
    StoppableContext context(stop);
    status = OfCall(call(context.get()), stop);
  } while (backoff.Again(status));
  return stop.stop_requested() && !status.ok() ? Stopped() : status;
}

}  // namespace isomatch
