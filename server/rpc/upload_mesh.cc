#include "server/rpc/upload_mesh.h"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <memory>
#include <new>
#include <string>
#include <utility>

#include <grpcpp/alarm.h>

#include "absl/strings/str_cat.h"
#include "core/base/mutex.h"
#include "core/base/status_macros.h"
#include "server/convert/mesh_upload.h"
#include "server/jobs/errors.h"
#include "server/jobs/within_memory.h"
#include "server/rpc/grpc_status.h"
#include "server/rpc/raw_message.h"
#include "server/rpc/refused.h"

namespace isomatch {
namespace {

/// The least bytes a second that an upload has to bring. A slower one holds
/// room that others need.
constexpr std::int64_t kLeastSpeed = 1024;

/// The longest that the upload of a whole mesh may take.
constexpr std::int64_t kMostSeconds = 3600;

/// The most fields that one message may have; a header has four.
constexpr int kMostFields = 8;

std::int64_t LeastSpeed(const v1::Digest& header) {
  return std::max(kLeastSpeed, static_cast<std::int64_t>(header.size_bytes()) /
                                   kMostSeconds);
}

/// One UploadMesh call.
///
///   1. Begin: starts to read the first message and sets the idle alarm.
///   2. OnReadDone: takes the message and reads the next. Finishes on an error,
///      or at once when the mesh is known. Threads of the disk do two things:
///      they take the header, to look whether the mesh is there, and at the end
///      of the stream they store the mesh and finish. Nothing else finishes the
///      call meanwhile.
///   3. The alarm: finishes when less than LeastSpeed came since it was set,
///      unless a thread of the disk is at work.
///   4. OnCancel: finishes with CANCELLED, unless a thread of the disk is at
///      work.
///   5. OnDone: nothing reads any more. Keeps the bytes of an upload that broke
///      off, in a thread of the disk if they go to a database, and lets go of
///      itself.
///
/// It holds itself alive from 1 to that; the alarm holds it weakly.
class UploadMeshReactor final
    : public grpc::ServerReadReactor<grpc::ByteBuffer>,
      public std::enable_shared_from_this<UploadMeshReactor> {
 public:
  UploadMeshReactor(const ServiceContext& context, const std::string& tenant,
                    MemoryBudget::Reservation place, grpc::ByteBuffer* response)
      : context_(context),
        tenant_(tenant),
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
    v1::UploadMeshRequest message;
    const absl::Status read = Read(message);
    if (!read.ok()) return FinishOnce(ToGrpc(read));
    if (message.has_header()) {
      OnDisk([this, message = std::move(message)] { Take(message); });
    } else {
      Take(message);
    }
  }

  void OnCancel() override { FinishUnlessOnDisk(grpc::Status::CANCELLED); }

  void OnDone() override {
    alarm_.Cancel();
    const auto last = std::move(self_);
    const bool asks_disk = context_.partial_uploads->AsksTheDisk();
    if (!asks_disk || !upload_.leaves_bytes()) return upload_.BreakOff();
    // Lost when it finds no place: the upload starts over.
    IfThereIsMemory([&] {
      (void)context_.disk->Post(tenant_, [last] {
        IfThereIsMemory([&] { last->upload_.BreakOff(); });
      });
    });
  }

 private:
  /// Parses what came and forgets its bytes.
  absl::Status Read(v1::UploadMeshRequest& message) {
    const grpc::ByteBuffer bytes = TakeBytes(&request_);
    const auto most =
        static_cast<std::size_t>(context_.parse.limits.max_request_bytes);
    ISOMATCH_RETURN_IF_ERROR(WithinMemory([&] {
      return ParseWithin({most, kMostFields}, bytes, message);
    }));
    if (!message.has_header() || bytes.Length() <= kSmallRequest.max_bytes) {
      return absl::OkStatus();
    }
    return UploadMalformed(absl::StrCat("a header of ", bytes.Length(),
                                        " bytes, expected at most ",
                                        kSmallRequest.max_bytes));
  }

  void Take(const v1::UploadMeshRequest& message) {
    const auto bytes = static_cast<std::int64_t>(message.chunk().size());
    received_bytes_ += bytes;
    context_.metrics->Uploaded(bytes);
    const absl::Status taken =
        WithinMemory([&] { return upload_.Take(message); });
    if (!taken.ok()) return FinishOnce(ToGrpc(taken));
    least_speed_ = LeastSpeed(upload_.digest());
    if (upload_.known()) return FinishWithAnswer();
    // Under the lock, so that nobody finishes in between.
    MutexLock lock(mutex_);
    on_disk_ = false;
    if (!finished_) StartRead(&request_);
  }

  /// The client is done, or the call has ended already.
  void OnEndOfStream() {
    OnDisk([this] { Store(); });
  }

  /// Calls `act()` in a thread of the disk, unless the call is finished;
  /// finishes it when too many of the tenant wait for the disk.
  template <typename Act>
  void OnDisk(Act act) {
    {
      MutexLock lock(mutex_);
      if (finished_) return;
      on_disk_ = true;
    }
    FinishWithoutMemory([&] {
      const absl::Status posted = context_.disk->Post(
          tenant_, [self = shared_from_this(), act = std::move(act)] {
            self->FinishWithoutMemory(act);
          });
      if (!posted.ok()) FinishOnce(ToGrpc(posted));
    });
  }

  void Store() {
    const absl::Status stored = WithinMemory([&] { return upload_.End(); });
    if (!stored.ok()) return FinishOnce(ToGrpc(stored));
    FinishWithAnswer();
  }

  /// Calls `act()`. Finishes the call when there is not even memory for an
  /// answer, since nothing else may finish it.
  template <typename Act>
  void FinishWithoutMemory(const Act& act) {
    try {
      act();
    } catch (const std::bad_alloc&) {
      FinishOnce({grpc::StatusCode::RESOURCE_EXHAUSTED, ""});
    }
  }

  void FinishWithAnswer() {
    v1::UploadMeshResponse answer;
    *answer.mutable_digest() = upload_.digest();
    answer.set_known(upload_.known());
    response_ = SerializeRaw(answer);
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
    if (more >= static_cast<double>(least) * absl::ToDoubleSeconds(time)) {
      return SetAlarmAgain();
    }
    if (FinishUnlessOnDisk(ToGrpc(UploadIdle(time, least)))) return;
    SetAlarmAgain();
  }

  void SetAlarmAgain() {
    // Under the lock, so that OnDone's Cancel comes after it.
    MutexLock lock(mutex_);
    if (!finished_) SetAlarm();
  }

  /// Finishes the call, unless a thread of the disk is at work; false then.
  bool FinishUnlessOnDisk(const grpc::Status& status) {
    {
      MutexLock lock(mutex_);
      if (on_disk_) return false;
      if (std::exchange(finished_, true)) return true;
    }
    Finish(status);
    return true;
  }

  void FinishOnce(const grpc::Status& status) {
    {
      MutexLock lock(mutex_);
      if (std::exchange(finished_, true)) return;
    }
    Finish(status);
  }

  const ServiceContext& context_;
  const std::string tenant_;
  const MemoryBudget::Reservation place_;
  std::shared_ptr<UploadMeshReactor> self_;
  grpc::Alarm alarm_;
  grpc::ByteBuffer request_;
  grpc::ByteBuffer& response_;
  /// Only used between two reads, and when all is done.
  MeshUpload upload_;
  std::atomic<std::int64_t> received_bytes_ = 0;
  std::atomic<std::int64_t> least_speed_ = kLeastSpeed;
  /// Only used by the alarm.
  std::int64_t received_at_alarm_ = 0;

  Mutex mutex_;
  /// A thread of the disk is at work. Nothing else finishes the call meanwhile.
  bool on_disk_ ABSL_GUARDED_BY(mutex_) = false;
  bool finished_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace

grpc::ServerReadReactor<grpc::ByteBuffer>* StartUploadMesh(
    const ServiceContext& context, const std::string& tenant,
    grpc::ByteBuffer* response) {
  auto place = context.uploads->Of(tenant).Reserve(1);
  if (!place.ok()) {
    return new Refused<grpc::ServerReadReactor<grpc::ByteBuffer>>(
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
