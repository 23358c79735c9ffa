#include "server/jobs/job_queue.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace isomatch {

void JobQueue::Push(std::shared_ptr<LiveJob> job) {
  mesh_bytes_ += job->mesh_bytes;
  jobs_.push_back(std::move(job));
}

std::shared_ptr<LiveJob> JobQueue::PopFitting(MemoryBudget& budget) {
  for (auto position = jobs_.begin(); position != jobs_.end(); ++position) {
    LiveJob& job = **position;
    auto reservation = budget.Reserve(job.memory_estimate_bytes);
    if (reservation.ok()) {
      job.reservation = *std::move(reservation);
      std::for_each(jobs_.begin(), position,
                    [](const auto& passed) { ++passed->passes; });
      return Take(position);
    }
    if (job.passes >= max_passes_) return nullptr;
  }
  return nullptr;
}

std::shared_ptr<LiveJob> JobQueue::Remove(const std::string& id) {
  const auto position =
      std::find_if(jobs_.begin(), jobs_.end(),
                   [&](const auto& job) { return job->id == id; });
  return position == jobs_.end() ? nullptr : Take(position);
}

std::shared_ptr<LiveJob> JobQueue::PopFront() {
  return jobs_.empty() ? nullptr : Take(jobs_.begin());
}

int JobQueue::JobsAhead(const std::string& id) const {
  const auto position =
      std::find_if(jobs_.begin(), jobs_.end(),
                   [&](const auto& job) { return job->id == id; });
  if (position == jobs_.end()) return 0;
  return static_cast<int>(std::distance(jobs_.begin(), position));
}

std::shared_ptr<LiveJob> JobQueue::Take(Jobs::iterator position) {
  std::shared_ptr<LiveJob> job = std::move(*position);
  jobs_.erase(position);
  mesh_bytes_ -= job->mesh_bytes;
  return job;
}

}  // namespace isomatch
