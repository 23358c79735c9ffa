#include "server/rpc/watch_job.h"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <grpcpp/alarm.h>

#include "core/base/mutex.h"
#include "server/convert/job_name.h"
#include "server/convert/job_proto.h"
#include "server/jobs/errors.h"
#include "server/jobs/within_memory.h"
#include "server/rpc/grpc_status.h"
#include "server/rpc/raw_message.h"
#include "server/rpc/refused.h"

namespace isomatch {
namespace {

constexpr absl::Duration kFirstHeartbeat = absl::Seconds(1);

/// One watcher of one job.
///
///   1. Begin: registers with the manager, sets the heartbeat, pumps once. The
///      first heartbeat comes early: who was cut off learns that there is a
///      server, and begins to count failures anew.
///   2. OnJobChanged or the heartbeat: pumps. If a write is under way only a
///      flag is set, so that a slow reader costs one message and no queue.
///   3. Pump: reads the newest snapshot, if the store answers, and writes it if
///      it is news. When it finds no place among the tenant's reads, the next
///      heartbeat comes early and tries again.
///   4. OnWriteDone: pumps again if the flag is set; after a terminal snapshot
///      finishes with OK.
///   5. OnCancel: finishes with CANCELLED, after the write that is under way.
///   6. When the server stops and the job goes on after it starts again:
///      finishes with UNAVAILABLE (DRAINING), after the write that is under
///      way.
///   7. OnDone: unregisters and lets go of itself.
///
/// It holds itself alive from 1 to 7; the manager and the alarm hold it weakly.
class WatchJobReactor final
    : public grpc::ServerWriteReactor<grpc::ByteBuffer>,
      public JobWatcher,
      public std::enable_shared_from_this<WatchJobReactor> {
 public:
  WatchJobReactor(const ServiceContext& context, Caller caller, std::string id,
                  std::uint64_t after_sequence)
      : context_(context),
        caller_(std::move(caller)),
        id_(std::move(id)),
        last_sequence_(after_sequence) {}

  void Begin() {
    self_ = shared_from_this();
    context_.manager->watchers().Add(id_, self_);
    SetHeartbeat(std::min(context_.watch_heartbeat, kFirstHeartbeat));
    PumpSoon(/*heartbeat=*/false);
  }

  void OnJobChanged() override { PumpSoon(/*heartbeat=*/false); }

  void OnWriteDone(bool ok) override {
    bool again = false;
    std::optional<grpc::Status> end;
    {
      MutexLock lock(mutex_);
      writing_ = false;
      again = std::exchange(news_waits_, false);
      if (!ok || cancelled_) end = grpc::Status::CANCELLED;
      if (ok && wrote_terminal_) end = grpc::Status::OK;
    }
    if (end) return FinishOnce(*end);
    if (again) PumpSoon(/*heartbeat=*/false);
  }

  void OnCancel() override {
    {
      MutexLock lock(mutex_);
      cancelled_ = true;
      if (writing_) return;  // OnWriteDone finishes
    }
    FinishOnce(grpc::Status::CANCELLED);
  }

  void OnDone() override {
    context_.manager->watchers().Remove(id_, this);
    alarm_.Cancel();
    const auto last = std::move(self_);
  }

 private:
  void SetHeartbeat(absl::Duration pause) {
    alarm_.Set(absl::ToChronoTime(absl::Now() + pause),
               [weak = weak_from_this()](bool ok) {
                 const auto self = weak.lock();
                 if (ok && self != nullptr) self->Beat();
               });
  }

  void Beat() {
    const bool pumps = PumpSoon(/*heartbeat=*/true);
    const absl::Duration pause =
        pumps ? context_.watch_heartbeat
              : std::min(context_.watch_heartbeat, kFirstHeartbeat);
    // Under the lock, so that OnDone's Cancel comes after it.
    MutexLock lock(mutex_);
    if (!finished_) SetHeartbeat(pause);
  }

  /// Pumps in another thread where jobs are in a database; once for all who ask
  /// before that. False when there is no place for it: a heartbeat has to try
  /// again.
  bool PumpSoon(bool heartbeat) {
    if (context_.reads == nullptr) {
      Pump(heartbeat);
      return true;
    }
    {
      MutexLock lock(mutex_);
      is_beat_asked_ = is_beat_asked_ || heartbeat;
      if (std::exchange(is_pump_posted_, true)) return true;
    }
    const absl::Status posted = WithinMemory([&] {
      return context_.reads->Post(
          caller_.tenant, [self = shared_from_this()] { self->PumpInTurn(); });
    });
    if (posted.ok()) return true;
    MutexLock lock(mutex_);
    is_pump_posted_ = false;
    return false;
  }

  void PumpInTurn() {
    bool beat = false;
    {
      MutexLock lock(mutex_);
      is_pump_posted_ = false;
      beat = std::exchange(is_beat_asked_, false);
      if (finished_ || cancelled_) return;
    }
    Pump(beat);
  }

  void Pump(bool heartbeat) {
    const auto snapshot = context_.manager->Get(caller_, id_);
    // The store does not answer: it will, and the next change comes.
    if (absl::IsUnavailable(snapshot.status())) return;
    if (!snapshot.ok()) return FinishOnce(ToGrpc(snapshot.status()));
    v1::WatchJobResponse message;
    v1::Job& job = *message.mutable_job();
    job = ToProto(*snapshot);
    const bool terminal = IsTerminal(snapshot->record.state);
    if (!terminal && context_.manager->has_stopped()) {
      return FinishOnce(ToGrpc(Draining(kRetryDraining)));
    }
    {
      MutexLock lock(mutex_);
      if (finished_ || cancelled_ || wrote_terminal_) return;
      if (job.sequence() < written_sequence_ && !terminal) {
        // Another was quicker. At two heartbeats in a row it was not: a crash
        // of the database has taken numbers back.
        if (!heartbeat || ++low_beats_ < 2) return;
        last_sequence_ = 0;
      }
      low_beats_ = 0;
      if (writing_) {
        news_waits_ = true;
        return;
      }
      const bool news = job.sequence() > last_sequence_ || terminal;
      if (!news && !heartbeat) return;
      if (job.sequence() > last_sequence_) last_sequence_ = job.sequence();
      written_sequence_ = job.sequence();
      writing_ = true;
      wrote_terminal_ = terminal;
      response_ = SerializeRaw(message);
    }
    StartWrite(&response_);
  }

  void FinishOnce(const grpc::Status& status) {
    {
      MutexLock lock(mutex_);
      if (finished_) return;
      if (writing_) {  // OnWriteDone looks again
        news_waits_ = true;
        return;
      }
      finished_ = true;
    }
    Finish(status);
  }

  const ServiceContext& context_;
  const Caller caller_;
  const std::string id_;
  std::shared_ptr<WatchJobReactor> self_;
  grpc::Alarm alarm_;

  Mutex mutex_;
  /// Sequence of the newest snapshot that the client has or will get.
  std::uint64_t last_sequence_ ABSL_GUARDED_BY(mutex_);
  /// Sequence of the snapshot that was written last.
  std::uint64_t written_sequence_ ABSL_GUARDED_BY(mutex_) = 0;
  /// Heartbeats in a row whose sequence was below that.
  int low_beats_ ABSL_GUARDED_BY(mutex_) = 0;
  /// `response_` belongs to gRPC.
  bool writing_ ABSL_GUARDED_BY(mutex_) = false;
  /// The job changed while writing.
  bool news_waits_ ABSL_GUARDED_BY(mutex_) = false;
  /// The last message is on its way.
  bool wrote_terminal_ ABSL_GUARDED_BY(mutex_) = false;
  bool cancelled_ ABSL_GUARDED_BY(mutex_) = false;
  bool finished_ ABSL_GUARDED_BY(mutex_) = false;
  /// A Pump waits for its turn; as a heartbeat.
  bool is_pump_posted_ ABSL_GUARDED_BY(mutex_) = false;
  bool is_beat_asked_ ABSL_GUARDED_BY(mutex_) = false;
  grpc::ByteBuffer response_;
};

}  // namespace

grpc::ServerWriteReactor<grpc::ByteBuffer>* StartWatchJob(
    const ServiceContext& context, const Caller& caller,
    const v1::WatchJobRequest& request) {
  const auto id = ParseJobName(request.name());
  absl::Status known = id.status();
  // In a database it is looked for by the first Pump.
  if (id.ok() && context.reads == nullptr) {
    known = context.manager->Get(caller, *id).status();
  }
  if (!known.ok()) {
    return new Refused<grpc::ServerWriteReactor<grpc::ByteBuffer>>(known);
  }
  // Not make_shared: the weak references of an alarm would keep its memory.
  const std::shared_ptr<WatchJobReactor> reactor(
      new WatchJobReactor(context, caller, *id, request.after_sequence()));
  reactor->Begin();
  return reactor.get();
}

}  // namespace isomatch
