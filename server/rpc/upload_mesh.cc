#include "server/rpc/upload_mesh.h"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <memory>
#include <new>
#include <string>
#include <utility>

#include <grpcpp/alarm.h>

#include "core/base/mutex.h"
#include "server/convert/mesh_upload.h"
#include "server/jobs/errors.h"
#include "server/jobs/within_memory.h"
#include "server/rpc/grpc_status.h"
#include "server/rpc/refused.h"

namespace isomatch {
namespace {

/// Bytes a second. Who sends less holds room that others need.
constexpr std::int64_t kLeastSpeed = 1024;

/// The longest that a whole mesh may take.
constexpr std::int64_t kMostSeconds = 3600;

std::int64_t LeastSpeed(const v1::Digest& header) {
  return std::max(kLeastSpeed, static_cast<std::int64_t>(header.size_bytes()) /
                                   kMostSeconds);
}

/// One UploadMesh call.
///
///   1. Begin: reads the first message, sets the idle alarm.
///   2. OnReadDone: takes the message, reads the next; finishes on an error, or
///      at once when the mesh is known. At the end of the stream the disk's
///      executor stores the mesh and finishes, whatever happens meanwhile.
///   3. The alarm: finishes when less than LeastSpeed came since it was set.
///   4. OnCancel: finishes with CANCELLED.
///   5. OnDone: nothing reads any more; keeps the bytes of an upload that broke
///      off, lets go of itself.
///
/// It holds itself alive from 1 to 5; the alarm holds it weakly.
class UploadMeshReactor final
    : public grpc::ServerReadReactor<v1::UploadMeshRequest>,
      public std::enable_shared_from_this<UploadMeshReactor> {
 public:
  UploadMeshReactor(const ServiceContext& context, const std::string& tenant,
                    MemoryBudget::Reservation place,
                    v1::UploadMeshResponse* response)
      : context_(context),
        place_(std::move(place)),
        response_(*response),
        upload_({context.blobs, context.partial_uploads, context.parse.limits},
                tenant) {}

  void Begin() {
    self_ = shared_from_this();
    SetAlarm();
    StartRead(&request_);
  }

  void OnReadDone(bool ok) override {
    if (!ok) return OnEndOfStream();
    const auto bytes = static_cast<std::int64_t>(request_.chunk().size());
    received_bytes_ += bytes;
    context_.metrics->Uploaded(bytes);
    const absl::Status taken =
        WithinMemory([&] { return upload_.Take(request_); });
    if (!taken.ok()) return FinishOnce(ToGrpc(taken));
    least_speed_ = LeastSpeed(upload_.digest());
    if (upload_.known()) return FinishWithAnswer();
    StartRead(&request_);
  }

  void OnCancel() override { FinishUnlessStoring(grpc::Status::CANCELLED); }

  void OnDone() override {
    alarm_.Cancel();
    upload_.BreakOff();
    const auto last = std::move(self_);
  }

 private:
  /// The client is done, or the call has ended already.
  void OnEndOfStream() {
    {
      MutexLock lock(mutex_);
      if (finished_) return;
      storing_ = true;
    }
    FinishWithoutMemory([&] {
      context_.disk->Post([this] { FinishWithoutMemory([&] { Store(); }); });
    });
  }

  void Store() {
    const absl::Status stored = WithinMemory([&] { return upload_.End(); });
    if (!stored.ok()) return FinishOnce(ToGrpc(stored));
    FinishWithAnswer();
  }

  /// Calls `act()`; finishes when there is not even memory for an answer, as
  /// nobody else may any more.
  template <typename Act>
  void FinishWithoutMemory(const Act& act) {
    try {
      act();
    } catch (const std::bad_alloc&) {
      FinishOnce({grpc::StatusCode::RESOURCE_EXHAUSTED, ""});
    }
  }

  void FinishWithAnswer() {
    *response_.mutable_digest() = upload_.digest();
    response_.set_known(upload_.known());
    FinishOnce(grpc::Status::OK);
  }

  void SetAlarm() {
    alarm_.Set(absl::ToChronoTime(absl::Now() + context_.upload_idle_timeout),
               [weak = weak_from_this()](bool ok) {
                 const auto self = weak.lock();
                 if (ok && self != nullptr) self->OnAlarm();
               });
  }

  void OnAlarm() {
    const absl::Duration time = context_.upload_idle_timeout;
    const std::int64_t received = received_bytes_;
    const auto more = static_cast<double>(received - received_at_alarm_);
    received_at_alarm_ = received;
    const std::int64_t least = least_speed_;
    if (more < static_cast<double>(least) * absl::ToDoubleSeconds(time)) {
      return FinishUnlessStoring(ToGrpc(UploadIdle(time, least)));
    }
    // Under the lock, so that OnDone's Cancel comes after it.
    MutexLock lock(mutex_);
    if (!finished_) SetAlarm();
  }

  void FinishUnlessStoring(const grpc::Status& status) {
    {
      MutexLock lock(mutex_);
      if (storing_ || std::exchange(finished_, true)) return;
    }
    Finish(status);
  }

  void FinishOnce(const grpc::Status& status) {
    {
      MutexLock lock(mutex_);
      if (std::exchange(finished_, true)) return;
    }
    Finish(status);
  }

  const ServiceContext& context_;
  const MemoryBudget::Reservation place_;
  std::shared_ptr<UploadMeshReactor> self_;
  grpc::Alarm alarm_;
  v1::UploadMeshRequest request_;
  v1::UploadMeshResponse& response_;
  /// Only used between two reads, and when all is done.
  MeshUpload upload_;
  std::atomic<std::int64_t> received_bytes_ = 0;
  std::atomic<std::int64_t> least_speed_ = kLeastSpeed;
  /// Only used by the alarm.
  std::int64_t received_at_alarm_ = 0;

  Mutex mutex_;
  /// Nobody but Store finishes from here on.
  bool storing_ ABSL_GUARDED_BY(mutex_) = false;
  bool finished_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace

grpc::ServerReadReactor<v1::UploadMeshRequest>* StartUploadMesh(
    const ServiceContext& context, const std::string& tenant,
    v1::UploadMeshResponse* response) {
  auto place = context.uploads->Of(tenant).Reserve(1);
  if (!place.ok()) {
    return new Refused<grpc::ServerReadReactor<v1::UploadMeshRequest>>(
        TenantUploadsQuota(tenant, context.uploads->share_bytes(),
                           kRetryUploadQuota));
  }
  // Not make_shared: the weak reference of the alarm would keep its memory.
  const std::shared_ptr<UploadMeshReactor> reactor(
      new UploadMeshReactor(context, tenant, *std::move(place), response));
  reactor->Begin();
  return reactor.get();
}

}  // namespace isomatch
