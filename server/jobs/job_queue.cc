#include "server/jobs/job_queue.h"

#include <algorithm>
#include <iterator>
#include <new>
#include <tuple>
#include <utility>

namespace isomatch {
namespace {

bool IsRisen(const LiveJob::Turn& turn) {
  return turn.overtakes >= JobQueue::kMaxOvertakes;
}

/// Whether the start of `job`, by its priority, overtakes another tenant's.
bool Overtakes(const LiveJob::Turn& turn, const LiveJob& job,
               const LiveJob& other_next) {
  return !IsRisen(turn) && job.shared_priority > other_next.shared_priority;
}

}  // namespace

void JobQueue::Push(std::shared_ptr<LiveJob> job) {
  Tenant& tenant = tenants_[job->tenant];
  Job& entry = by_id_[job->id];
  if (job->arrival == 0) job->arrival = ++last_arrival_;
  try {
    tenant.waiting.insert(job);
  } catch (const std::bad_alloc&) {
    by_id_.erase(job->id);
    throw;
  }
  positions_.clear();
  if (job->turn.last_served > 0 &&
      job->turn.last_served == tenant.turn.last_served) {
    tenant.turn = {job->turn_before.last_served,
                   job->turn_before.overtakes + tenant.turn.overtakes};
  }
  entry = std::move(job);
}

std::shared_ptr<LiveJob> JobQueue::PopFitting(MemoryBudget& budget,
                                              std::int64_t most_bytes) {
  std::shared_ptr<LiveJob> next;
  std::vector<LiveJob*> passed;
  Walk([&](const Job& job) {
    if (job->memory_estimate_bytes > most_bytes) return true;
    if (tenants_[job->tenant].running >= max_running_per_tenant_) return true;
    auto reservation = budget.Reserve(job->memory_estimate_bytes);
    if (reservation.ok()) {
      job->reservation = *std::move(reservation);
      next = job;
      return false;
    }
    passed.push_back(job.get());
    return job->passes < max_passes_;
  });
  if (next == nullptr) return nullptr;
  for (LiveJob* job : passed) ++job->passes;
  Serve(*next);
  return Remove(next->id);
}

void JobQueue::Serve(LiveJob& job) {
  Tenant& tenant = tenants_[job.tenant];
  for (auto& [name, other] : tenants_) {
    const auto other_next =
        FirstFree(other.waiting.begin(), other.waiting.end());
    if (&other == &tenant || other_next == other.waiting.end()) continue;
    if (Overtakes(tenant.turn, job, **other_next)) ++other.turn.overtakes;
  }
  job.turn_before = tenant.turn;
  tenant.turn = job.turn = {++last_served_, 0};
  ++tenant.running;
}

void JobQueue::OnEnded(const std::string& tenant) {
  --tenants_[tenant].running;
  positions_.clear();
}

std::shared_ptr<LiveJob> JobQueue::Remove(const std::string& id) {
  const auto found = by_id_.find(id);
  if (found == by_id_.end()) return nullptr;
  std::shared_ptr<LiveJob> job = std::move(found->second);
  by_id_.erase(found);
  tenants_[job->tenant].waiting.erase(job);
  positions_.clear();
  return job;
}

std::shared_ptr<LiveJob> JobQueue::PopAny() {
  return by_id_.empty() ? nullptr : Remove(by_id_.begin()->first);
}

int JobQueue::JobsAhead(const std::string& id) const {
  if (by_id_.count(id) == 0) return 0;
  if (positions_.empty()) {
    std::unordered_map<std::string, int> positions;
    Walk([&](const Job& job) {
      const auto ahead = static_cast<int>(positions.size());
      positions[job->id] = ahead;
      return true;
    });
    const auto free = static_cast<int>(positions.size());
    for (const auto& [held, job] : by_id_) positions.try_emplace(held, free);
    positions_.swap(positions);
  }
  return positions_.at(id);
}

bool JobQueue::HasLargerThan(std::int64_t bytes) const {
  return std::any_of(by_id_.begin(), by_id_.end(), [&](const auto& entry) {
    const LiveJob& job = *entry.second;
    return !job.is_held && job.memory_estimate_bytes > bytes;
  });
}

void JobQueue::EndHold(LiveJob& job) {
  job.is_held = false;
  positions_.clear();
}

int JobQueue::CountHeld() const {
  return static_cast<int>(
      std::count_if(by_id_.begin(), by_id_.end(), [](const auto& entry) {
        return entry.second->is_held && entry.second->awaited_bytes == 0;
      }));
}

int JobQueue::CountAwaitingRoom() const {
  return static_cast<int>(
      std::count_if(by_id_.begin(), by_id_.end(), [](const auto& entry) {
        return entry.second->is_held && entry.second->awaited_bytes > 0;
      }));
}

std::map<std::int32_t, int> JobQueue::CountByPriority() const {
  std::map<std::int32_t, int> counts;
  for (const auto& [id, job] : by_id_) ++counts[job->priority];
  return counts;
}

int JobQueue::CountOf(const std::string& tenant) const {
  const auto found = tenants_.find(tenant);
  if (found == tenants_.end()) return 0;
  return static_cast<int>(found->second.waiting.size());
}

bool JobQueue::Walker::operator<(const Walker& other) const {
  const LiveJob& job = **next;
  const LiveJob& other_job = **other.next;
  if (may_start() != other.may_start()) return may_start();
  const bool is_risen = IsRisen(turn);
  if (is_risen != IsRisen(other.turn)) return is_risen;
  if (!is_risen && job.shared_priority != other_job.shared_priority) {
    return job.shared_priority > other_job.shared_priority;
  }
  return std::tie(running, turn.last_served, job.arrival) <
         std::tie(other.running, other.turn.last_served, other_job.arrival);
}

JobQueue::Jobs::const_iterator JobQueue::FirstFree(Jobs::const_iterator from,
                                                   Jobs::const_iterator end) {
  return std::find_if(from, end, [](const Job& job) { return !job->is_held; });
}

std::vector<JobQueue::Walker> JobQueue::Line() const {
  std::vector<Walker> line;
  for (const auto& [name, tenant] : tenants_) {
    const auto end = tenant.waiting.end();
    const auto next = FirstFree(tenant.waiting.begin(), end);
    if (next == end) continue;
    line.push_back(
        {tenant.turn, tenant.running, max_running_per_tenant_, next, end});
  }
  return line;
}

void JobQueue::Walk(const Visit& visit) const {
  std::vector<Walker> line = Line();
  std::uint64_t served = last_served_;
  while (!line.empty()) {
    const auto walker = std::min_element(line.begin(), line.end());
    if (!visit(*walker->next)) return;
    for (Walker& other : line) {
      if (Overtakes(walker->turn, **walker->next, **other.next)) {
        ++other.turn.overtakes;
      }
    }
    walker->turn = {++served, 0};
    ++walker->running;
    walker->next = FirstFree(std::next(walker->next), walker->end);
    if (walker->next == walker->end) line.erase(walker);
  }
}

}  // namespace isomatch
