#include "client/api/call_retry.h"

#include <algorithm>
#include <condition_variable>
#include <mutex>

#include "absl/strings/match.h"
#include "absl/time/clock.h"
#include "client/api/rpc_status.h"

namespace isomatch {
namespace {

// Sleeps; returns at once when `stop` is requested.
void Pause(absl::Duration duration, const std::stop_token& stop) {
  std::mutex mutex;
  std::condition_variable_any never;
  std::unique_lock lock(mutex);
  never.wait_for(lock, stop, absl::ToChronoMilliseconds(duration),
                 [] { return false; });
}

// gRPC's own words, and no details, which every error of the service has.
bool WasReset(const grpc::Status& status) {
  return status.error_code() == grpc::StatusCode::INTERNAL &&
         status.error_details().empty() &&
         absl::StrContains(status.error_message(), "RST_STREAM");
}

}  // namespace

void Backoff::Reset() {
  give_up_ = absl::InfiniteFuture();
  pause_ = kFirstPause;
}

bool Backoff::Again(const absl::Status& status) {
  const absl::Time now = absl::Now();
  give_up_ = std::min(give_up_, now + patience_);
  if (status.code() != absl::StatusCode::kUnavailable ||
      now + pause_ > give_up_) {
    return false;
  }
  Pause(pause_ * std::uniform_real_distribution<double>(0.8, 1.2)(jitter_),
        stop_);
  pause_ = std::min(2 * pause_, kLongestPause);
  return !stop_.stop_requested();
}

absl::Status Stopped() { return absl::CancelledError("cancelled by the user"); }

absl::Status OfCall(const grpc::Status& status, const std::stop_token& stop) {
  if (status.error_code() == grpc::StatusCode::CANCELLED &&
      !stop.stop_requested()) {
    return absl::UnavailableError("the server ended the call");
  }
  if (WasReset(status)) return absl::UnavailableError(status.error_message());
  return FromGrpc(status);
}

}  // namespace isomatch
