#include "server/jobs/job_intake.h"

#include <algorithm>
#include <cstdint>
#include <utility>

#include "core/base/status_macros.h"
#include "server/jobs/errors.h"
#include "server/jobs/within_memory.h"

namespace isomatch {
namespace {

// What a client is told to wait before it tries again.
constexpr absl::Duration kRetryQueueFull = absl::Seconds(5);
constexpr absl::Duration kRetryDraining = absl::Seconds(10);

}  // namespace

/// Made before the lock is taken: what goes wrong on the way gives back what
/// was taken, under the lock.
class JobIntake::Seat {
 public:
  Seat(JobIntake* intake, std::string tenant)
      : intake_(intake), tenant_(std::move(tenant)) {}
  Seat(const Seat&) = delete;
  Seat& operator=(const Seat&) = delete;
  ~Seat() {
    if (is_taken_) intake_->GiveSeatBack(tenant_);
  }

  const std::string& tenant() const { return tenant_; }
  void SetTaken() { is_taken_ = true; }

 private:
  JobIntake* const intake_;
  const std::string tenant_;
  bool is_taken_ = false;
};

absl::StatusOr<std::optional<JobSnapshot>> JobIntake::FindRequest(
    const Caller& caller, const std::string& request_id,
    const std::string& request_sha256) const {
  if (request_id.empty()) return std::nullopt;
  auto record = environment_.jobs->FindByRequestId(caller.tenant, request_id);
  if (absl::IsNotFound(record.status())) return std::nullopt;
  if (!record.ok()) return StorageSilent(record.status());
  if (record->request_sha256 != request_sha256) {
    return RequestIdReused(request_id);
  }
  return scheduler_.SnapshotOf(*std::move(record));
}

absl::StatusOr<JobIntake::SeatPtr> JobIntake::TakeSeat(
    const Caller& caller, const std::string& request_id) {
  const auto seat = std::make_shared<Seat>(this, caller.tenant);
  QueueRoom shared_room = {};
  const QueueRoom* shared = nullptr;
  if (environment_.shared != nullptr) {
    ISOMATCH_ASSIGN_OR_RETURN(shared_room,
                              scheduler_.SharedRoomFor(caller.tenant));
    shared = &shared_room;
  }
  {
    MutexLock lock(mutex_);
    const absl::Status taken = TakeSeatLocked(*seat, shared);
    if (taken.ok()) return seat;
    if (request_id.empty()) return taken;
  }
  // The answer may be the job that the request has made before.
  if (environment_.jobs->FindByRequestId(caller.tenant, request_id).ok()) {
    return SeatPtr();
  }
  MutexLock lock(mutex_);
  // There may be one by now.
  ISOMATCH_RETURN_IF_ERROR(TakeSeatLocked(*seat, shared));
  return seat;
}

absl::Status JobIntake::TakeSeatLocked(Seat& seat, const QueueRoom* shared) {
  // A job keeps its seat until it is in the queue: for a moment it may count
  // twice, and at no time does it count as none.
  ISOMATCH_RETURN_IF_ERROR(CheckRoomLocked(
      seat.tenant(),
      shared != nullptr ? *shared : scheduler_.RoomFor(seat.tenant())));
  seated_.insert(seat.tenant());
  seat.SetTaken();
  return absl::OkStatus();
}

void JobIntake::GiveSeatBack(const std::string& tenant) {
  MutexLock lock(mutex_);
  seated_.erase(seated_.find(tenant));
}

absl::Status JobIntake::CheckRoomLocked(const std::string& tenant,
                                        const QueueRoom& room) const {
  if (room.draining) return Draining(kRetryDraining);
  const int waiting = room.queued_jobs + static_cast<int>(seated_.size());
  if (waiting >= environment_.limits.max_queued_jobs) {
    return QueueFull(waiting, kRetryQueueFull);
  }
  const int own =
      room.queued_of_tenant + static_cast<int>(seated_.count(tenant));
  if (own >= environment_.limits.tenant.queued_jobs) {
    return TenantQuota(tenant, own, kRetryQueueFull);
  }
  return absl::OkStatus();
}

absl::StatusOr<JobSnapshot> JobIntake::Create(const Caller& caller,
                                              JobSpec spec, SeatPtr seat) {
  ISOMATCH_ASSIGN_OR_RETURN(
      std::optional<JobSnapshot> before,
      FindRequest(caller, spec.request_id, spec.request_sha256));
  if (before) return *std::move(before);
  JobRecord record = NewRecord(caller, spec);
  const std::int64_t budget_bytes = scheduler_.Workers().job_bytes;
  if (budget_bytes > 0 && record.memory_estimate_bytes > budget_bytes) {
    return JobNeedsMoreMemoryThanBudget(record.memory_estimate_bytes,
                                        budget_bytes);
  }
  if (spec.validate_only) return JobSnapshot{std::move(record), 0};
  if (seat == nullptr) {
    ISOMATCH_ASSIGN_OR_RETURN(seat, TakeSeat(caller, ""));
  }
  record.id = environment_.new_id();
  return Accept(caller, record, std::make_unique<JobSpec>(std::move(spec)));
}

JobRecord JobIntake::NewRecord(const Caller& caller,
                               const JobSpec& spec) const {
  JobRecord record;
  record.tenant = caller.tenant;
  record.call_id = caller.call_id;
  record.trace_parent = caller.trace_parent;
  record.memory_estimate_bytes = environment_.runner->EstimateBytes(spec);
  record.create_time = environment_.now();
  record.labels = spec.labels;
  record.request_id = spec.request_id;
  record.request_sha256 = spec.request_sha256;
  record.priority = spec.priority;
  record.shared_priority = std::min(spec.priority, caller.max_priority);
  record.cancel_when_unwatched = spec.cancel_when_unwatched;
  record.queue_timeout = spec.queue_timeout;
  record.deadline = spec.deadline;
  if (const auto limit = environment_.limits.RunTime(spec.run_timeout);
      limit < absl::InfiniteDuration()) {
    record.run_timeout = limit;
  }
  record.threads = spec.options.threads;
  for (const JobInput& input : spec.inputs) {
    record.inputs.push_back(input.sha256);
  }
  return record;
}

absl::StatusOr<JobSnapshot> JobIntake::Accept(const Caller& caller,
                                              const JobRecord& record,
                                              std::unique_ptr<JobSpec> spec) {
  const std::string& id = record.id;
  // Before others can end it, so that its end finds it guarded.
  const bool is_guarded =
      record.cancel_when_unwatched && environment_.shared == nullptr;
  if (is_guarded) lifecycle_.guard().Guard(id);
  const auto stored = Store(record, std::exchange(spec->inputs, {}));
  if (!stored.ok()) {
    lifecycle_.guard().Release(id);
    // The same request may have come twice at the same time.
    ISOMATCH_ASSIGN_OR_RETURN(
        std::optional<JobSnapshot> other,
        FindRequest(caller, record.request_id, record.request_sha256));
    if (other) return *std::move(other);
    return stored.status();
  }
  const absl::Status queued = WithinMemory([&] {
    environment_.on_state(*stored);
    scheduler_.Enqueue(*stored, std::move(spec));
    return absl::OkStatus();
  });
  if (!queued.ok()) {
    WhenThereIsMemory(
        [&] { scheduler_.FailIfStill(JobState::kQueued, id, queued); });
  }
  ISOMATCH_ASSIGN_OR_RETURN(JobRecord now, lifecycle_.Find(caller, id));
  return scheduler_.SnapshotOf(std::move(now));
}

absl::StatusOr<JobRecord> JobIntake::Store(const JobRecord& record,
                                           std::vector<JobInput> inputs) {
  ISOMATCH_RETURN_IF_ERROR(StoreInputs(record, std::move(inputs)));
  auto stored = environment_.jobs->Insert(record);
  if (stored.ok()) return stored;
  retention_.UnpinInputs(record);
  if (absl::IsAlreadyExists(stored.status())) return stored;
  return StorageFailed(stored.status());
}

absl::Status JobIntake::StoreInputs(const JobRecord& record,
                                    std::vector<JobInput> inputs) {
  // What is there first, so that it does not make room for the others.
  std::stable_partition(
      inputs.begin(), inputs.end(),
      [](const JobInput& input) { return !input.bytes.has_value(); });
  JobRecord done;
  done.tenant = record.tenant;
  for (JobInput& input : inputs) {
    if (absl::Status status = StoreInput(record.tenant, input); !status.ok()) {
      retention_.UnpinInputs(done);
      return status;
    }
    done.inputs.push_back(input.sha256);
  }
  return absl::OkStatus();
}

absl::Status JobIntake::StoreInput(const std::string& tenant, JobInput& input) {
  const BlobKey key = {tenant, input.sha256};
  BlobStore& blobs = *environment_.blobs;
  if (!input.bytes) {
    if (blobs.Pin(key)) return absl::OkStatus();
    return MeshMissing("digest", input.sha256);  // it went since it was read
  }
  const auto size = static_cast<std::int64_t>(input.bytes->size());
  const std::int64_t limit = environment_.limits.tenant.stored_bytes;
  const absl::Status put =
      blobs.PutWithin(limit, key, *std::move(input.bytes), Keep::kPinned);
  if (absl::IsFailedPrecondition(put)) return StorageQuota(tenant, size, limit);
  return put.ok() ? put : StorageFailed(put);
}

}  // namespace isomatch
