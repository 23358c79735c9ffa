#include "server/rpc/upload_mesh.h"

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include <grpcpp/alarm.h>

#include "absl/strings/str_cat.h"
#include "core/base/mutex.h"
#include "core/base/status_macros.h"
#include "server/convert/digest.h"
#include "server/jobs/errors.h"
#include "server/rpc/grpc_status.h"
#include "server/storage/sha256.h"

namespace isomatch {
namespace {

/// What has come of one upload. Not thread-safe.
class Upload {
 public:
  Upload(const ServiceContext& context, Caller caller,
         v1::UploadMeshResponse* response)
      : context_(context), caller_(std::move(caller)), response_(*response) {}

  /// Takes the next message.
  absl::Status Take(const v1::UploadMeshRequest& request) {
    if (request.has_header()) return Begin(request.header());
    if (request.has_chunk()) return Append(request.chunk());
    return UploadMalformed("an empty message, expected header or chunk");
  }

  /// True when the server has the mesh and needs no chunks.
  bool known() const { return response_.known(); }

  /// Checks size and digest and stores the mesh.
  absl::Status End() {
    if (!begun_) return UploadMalformed("no header came");
    const v1::Digest& digest = response_.digest();
    if (bytes_.size() != digest.size_bytes()) {
      return UploadMalformed(absl::StrCat("the chunks have ", bytes_.size(),
                                          " bytes, the header says ",
                                          digest.size_bytes()));
    }
    const std::string found = sha256_.HexDigest();
    if (found != digest.sha256()) {
      return DigestMismatch(digest.sha256(), found);
    }
    if (context_.blobs
            ->Put({caller_.tenant, found}, std::move(bytes_), Keep::kWhileRoom)
            .ok()) {
      return absl::OkStatus();
    }
    return NoRoom();
  }

 private:
  absl::Status Begin(const v1::Digest& digest) {
    if (begun_) return UploadMalformed("a second header");
    ISOMATCH_RETURN_IF_ERROR(
        ValidateDigest(digest, "header", context_.parse.limits));
    begun_ = true;
    *response_.mutable_digest() = digest;
    response_.set_known(context_.blobs->Has({caller_.tenant, digest.sha256()}));
    if (response_.known()) return absl::OkStatus();
    auto reservation = context_.uploads->Reserve(
        static_cast<std::int64_t>(digest.size_bytes()));
    if (!reservation.ok()) return NoRoom();
    reservation_ = *std::move(reservation);
    return absl::OkStatus();
  }

  absl::Status Append(const std::string& chunk) {
    if (!begun_) return UploadMalformed("a chunk before the header");
    const RequestLimits& limits = context_.parse.limits;
    if (chunk.size() > static_cast<size_t>(limits.max_chunk_bytes)) {
      return UploadMalformed(absl::StrCat("a chunk of ", chunk.size(),
                                          " bytes, expected at most ",
                                          limits.max_chunk_bytes));
    }
    if (chunk.size() > response_.digest().size_bytes() - bytes_.size()) {
      return UploadMalformed(absl::StrCat("more bytes than the ",
                                          response_.digest().size_bytes(),
                                          " that the header says"));
    }
    sha256_.Update(chunk);
    bytes_ += chunk;
    context_.metrics->Uploaded(static_cast<std::int64_t>(chunk.size()));
    return absl::OkStatus();
  }

  absl::Status NoRoom() const {
    return UploadQuota(
        static_cast<std::int64_t>(response_.digest().size_bytes()),
        kRetryUploadQuota);
  }

  const ServiceContext& context_;
  const Caller caller_;
  v1::UploadMeshResponse& response_;
  bool begun_ = false;
  MemoryBudget::Reservation reservation_;
  Sha256 sha256_;
  std::string bytes_;
};

/// One UploadMesh call.
///
///   1. Begin: reads the first message, sets the idle alarm.
///   2. OnReadDone: takes the message, reads the next; finishes on an error, or
///      at once when the mesh is known, or, at the end of the stream, when the
///      mesh is stored.
///   3. The alarm: finishes when nothing came since it was set.
///   4. OnCancel: finishes with CANCELLED.
///   5. OnDone: lets go of itself and so of bytes and reservation.
///
/// It holds itself alive from 1 to 5; the alarm holds it weakly.
class UploadMeshReactor final
    : public grpc::ServerReadReactor<v1::UploadMeshRequest>,
      public std::enable_shared_from_this<UploadMeshReactor> {
 public:
  UploadMeshReactor(const ServiceContext& context, const Caller& caller,
                    v1::UploadMeshResponse* response)
      : context_(context), upload_(context, caller, response) {}

  void Begin() {
    self_ = shared_from_this();
    SetAlarm();
    StartRead(&request_);
  }

  void OnReadDone(bool ok) override {
    ++reads_;
    if (!ok) return OnEndOfStream();
    const absl::Status taken = upload_.Take(request_);
    if (!taken.ok() || upload_.known()) return FinishOnce(ToGrpc(taken));
    StartRead(&request_);
  }

  void OnCancel() override { FinishOnce(grpc::Status::CANCELLED); }

  void OnDone() override {
    alarm_.Cancel();
    const auto last = std::move(self_);
  }

 private:
  /// The client is done, or the call has ended already.
  void OnEndOfStream() {
    {
      MutexLock lock(mutex_);
      if (finished_) return;
    }
    FinishOnce(ToGrpc(upload_.End()));
  }

  void SetAlarm() {
    alarm_.Set(absl::ToChronoTime(absl::Now() + context_.upload_idle_timeout),
               [weak = weak_from_this()](bool ok) {
                 const auto self = weak.lock();
                 if (ok && self != nullptr) self->OnAlarm();
               });
  }

  void OnAlarm() {
    const bool idle = reads_ == reads_at_alarm_;
    reads_at_alarm_ = reads_;
    if (idle) {
      return FinishOnce(ToGrpc(UploadIdle(context_.upload_idle_timeout)));
    }
    // Under the lock, so that OnDone's Cancel comes after it.
    MutexLock lock(mutex_);
    if (!finished_) SetAlarm();
  }

  void FinishOnce(const grpc::Status& status) {
    {
      MutexLock lock(mutex_);
      if (std::exchange(finished_, true)) return;
    }
    Finish(status);
  }

  const ServiceContext& context_;
  std::shared_ptr<UploadMeshReactor> self_;
  grpc::Alarm alarm_;
  v1::UploadMeshRequest request_;
  /// Only used between two reads.
  Upload upload_;
  std::atomic<std::int64_t> reads_ = 0;
  /// Only used by the alarm.
  std::int64_t reads_at_alarm_ = 0;

  Mutex mutex_;
  bool finished_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace

grpc::ServerReadReactor<v1::UploadMeshRequest>* StartUploadMesh(
    const ServiceContext& context, const Caller& caller,
    v1::UploadMeshResponse* response) {
  // Not make_shared: the weak reference of the alarm would keep its memory.
  const std::shared_ptr<UploadMeshReactor> reactor(
      new UploadMeshReactor(context, caller, response));
  reactor->Begin();
  return reactor.get();
}

}  // namespace isomatch
