#include "server/jobs/shared_queue.h"

#include <algorithm>
#include <cstddef>
#include <new>
#include <optional>
#include <utility>
#include <vector>

namespace isomatch {
namespace {

/// How old an answer may be.
constexpr absl::Duration kRecent = absl::Seconds(1);

/// Inputs that are remembered; each job has a request and two meshes.
constexpr std::size_t kMostMeshes = 64;

}  // namespace

template <typename Value, typename Ask>
Value SharedQueue::Refresh(Recent<Value>& recent, const Ask& ask) {
  const absl::Duration now = environment_.uptime();
  {
    MutexLock lock(mutex_);
    if (now - recent.asked < kRecent) return recent.value;
    recent.asked = now;  // others need not ask meanwhile
  }
  absl::StatusOr<Value> answer = ask();
  MutexLock lock(mutex_);
  if (answer.ok()) recent.value = *std::move(answer);
  return recent.value;
}

std::shared_ptr<LiveJob> SharedQueue::Claim() {
  {
    MutexLock lock(mutex_);
    is_asked_again_ = true;
    if (is_claiming_) return nullptr;
    is_claiming_ = true;
  }
  std::shared_ptr<LiveJob> live;
  while (true) {
    {
      MutexLock lock(mutex_);
      if (live != nullptr || !is_asked_again_) {
        is_claiming_ = false;
        return live;
      }
      is_asked_again_ = false;
    }
    try {
      live = ClaimOne();
    } catch (const std::bad_alloc&) {
      MutexLock lock(mutex_);
      is_claiming_ = false;
      throw;
    }
  }
}

ClaimRequest SharedQueue::MakeRequest() {
  const MemoryBudget& budget = *environment_.budget;
  ClaimRequest request;
  request.worker = environment_.process;
  request.free_bytes = budget.total_bytes() - budget.reserved_bytes();
  request.total_bytes = budget.total_bytes();
  request.lease = environment_.lease;
  request.max_running_per_tenant = environment_.limits.tenant.running_jobs;
  request.max_passes = environment_.limits.max_passes;
  request.max_overtakes = JobQueue::kMaxOvertakes;
  request.alone_after = kAloneAfter;
  MutexLock lock(mutex_);
  request.meshes.assign(meshes_.begin(), meshes_.end());
  return request;
}

void SharedQueue::Remember(const std::vector<std::string>& inputs) {
  MutexLock lock(mutex_);
  for (const std::string& sha256 : inputs) {
    std::erase(meshes_, sha256);
    meshes_.push_front(sha256);
  }
  if (meshes_.size() > kMostMeshes) meshes_.resize(kMostMeshes);
}

std::shared_ptr<LiveJob> SharedQueue::ClaimOne() {
  const ClaimRequest request = MakeRequest();
  const absl::Duration begin = environment_.uptime();
  auto claimed = environment_.shared->Claim(request);
  {
    MutexLock lock(mutex_);
    last_claim_ = claimed.status();
  }
  if (!claimed.ok()) {
    environment_.metrics->ClaimFailed();
    return nullptr;
  }
  environment_.metrics->Claimed(claimed->has_value() ? 1 : 0,
                                environment_.uptime() - begin);
  if (!*claimed) return nullptr;
  JobRecord& record = **claimed;
  auto live = std::make_shared<LiveJob>();
  live->id = record.id;
  live->tenant = record.tenant;
  live->priority = record.priority;
  live->shared_priority = record.shared_priority;
  live->times_held = record.times_held;
  live->unreadable = record.unreadable;
  // This attempt is counted already.
  live->memory_estimate_bytes = record.attempt <= kAloneAfter
                                    ? record.memory_estimate_bytes
                                    : request.total_bytes;
  // Only this thread takes any: it is there.
  auto reservation = environment_.budget->Reserve(live->memory_estimate_bytes);
  if (reservation.ok()) live->reservation = *std::move(reservation);
  Remember(record.inputs);
  live->claimed = std::move(record);
  return live;
}

int SharedQueue::PositionOf(const std::string& id) {
  const Positions positions =
      Refresh(positions_, [&]() -> absl::StatusOr<Positions> {
        const auto order = environment_.shared->InOrder();
        if (!order.ok()) return order.status();
        auto found = std::make_shared<std::unordered_map<std::string, int>>();
        for (const std::string& next : *order) {
          found->emplace(next, static_cast<int>(found->size()));
        }
        return Positions(std::move(found));
      });
  if (positions == nullptr) return 0;
  const auto found = positions->find(id);
  // One that has come since then is the last.
  return found == positions->end() ? static_cast<int>(positions->size())
                                   : found->second;
}

QueueCounts SharedQueue::Counts() {
  return Refresh(counts_, [&] { return environment_.shared->Count(); });
}

WorkerFigures SharedQueue::Workers() {
  return Refresh(workers_, [&]() -> absl::StatusOr<WorkerFigures> {
    const auto workers = environment_.shared->Workers(kWorkerAge);
    if (!workers.ok()) return workers.status();
    WorkerFigures all;
    for (const WorkerEntry& worker : *workers) {
      all.slots += worker.slots;
      all.threads = std::max(all.threads, worker.threads);
      all.job_bytes = std::max(all.job_bytes, worker.memory_bytes);
    }
    return all;
  });
}

}  // namespace isomatch
