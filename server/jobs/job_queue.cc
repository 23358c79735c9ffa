#include "server/jobs/job_queue.h"

#include <queue>
#include <tuple>
#include <utility>
#include <vector>

namespace isomatch {
namespace {

using Counts = std::unordered_map<std::string, int>;

int CountIn(const Counts& counts, const std::string& tenant) {
  const auto found = counts.find(tenant);
  return found == counts.end() ? 0 : found->second;
}

void Decrease(Counts& counts, const std::string& tenant) {
  const auto found = counts.find(tenant);
  if (found != counts.end() && --found->second == 0) counts.erase(found);
}

}  // namespace

void JobQueue::Push(std::shared_ptr<LiveJob> job) {
  ++waiting_[job->tenant];
  const std::string id = job->id;
  Jobs& jobs = levels_[job->priority][job->tenant];
  jobs.push_back({std::move(job), ++last_number_});
  by_id_[id] = std::prev(jobs.end());
}

std::shared_ptr<LiveJob> JobQueue::PopFitting(MemoryBudget& budget) {
  std::shared_ptr<LiveJob> next;
  std::vector<LiveJob*> passed;
  Walk([&](const std::shared_ptr<LiveJob>& job) {
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
  ++running_[next->tenant];
  return Remove(next->id);
}

void JobQueue::OnEnded(const std::string& tenant) {
  Decrease(running_, tenant);
}

std::shared_ptr<LiveJob> JobQueue::Remove(const std::string& id) {
  const auto found = by_id_.find(id);
  if (found == by_id_.end()) return nullptr;
  std::shared_ptr<LiveJob> job = std::move(found->second->job);
  const auto level = levels_.find(job->priority);
  const auto tenant = level->second.find(job->tenant);
  tenant->second.erase(found->second);
  if (tenant->second.empty()) level->second.erase(tenant);
  if (level->second.empty()) levels_.erase(level);
  by_id_.erase(found);
  Decrease(waiting_, job->tenant);
  return job;
}

std::shared_ptr<LiveJob> JobQueue::PopAny() {
  return by_id_.empty() ? nullptr : Remove(by_id_.begin()->first);
}

int JobQueue::JobsAhead(const std::string& id) const {
  if (by_id_.count(id) == 0) return 0;
  int ahead = 0;
  Walk([&](const std::shared_ptr<LiveJob>& job) {
    if (job->id == id) return false;
    ++ahead;
    return true;
  });
  return ahead;
}

std::map<std::int32_t, int> JobQueue::CountByPriority() const {
  std::map<std::int32_t, int> counts;
  for (const auto& [priority, tenants] : levels_) {
    for (const auto& [tenant, jobs] : tenants) {
      counts[priority] += static_cast<int>(jobs.size());
    }
  }
  return counts;
}

int JobQueue::CountOf(const std::string& tenant) const {
  return CountIn(waiting_, tenant);
}

void JobQueue::Walk(const Visit& visit) const {
  for (const auto& [priority, tenants] : levels_) {
    if (!WalkLevel(tenants, visit)) return;
  }
}

bool JobQueue::WalkLevel(const Tenants& tenants, const Visit& visit) const {
  // The next job of each tenant; its turn, then its arrival decide.
  struct Next {
    int turn;
    Jobs::const_iterator job;
    const Jobs* jobs;
    bool operator<(const Next& other) const {  // the last is visited first
      return std::tie(turn, job->number) >
             std::tie(other.turn, other.job->number);
    }
  };
  std::priority_queue<Next> line;
  for (const auto& [tenant, jobs] : tenants) {
    line.push({CountIn(running_, tenant), jobs.begin(), &jobs});
  }
  while (!line.empty()) {
    Next next = line.top();
    line.pop();
    if (!visit(next.job->job)) return false;
    ++next.turn;
    if (++next.job != next.jobs->end()) line.push(next);
  }
  return true;
}

}  // namespace isomatch
