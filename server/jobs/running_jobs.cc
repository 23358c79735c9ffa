#include "server/jobs/running_jobs.h"

namespace isomatch {

void RunningJobs::Begin(const std::string& id, std::int64_t resident_bytes) {
  const absl::Duration now = clock_();
  MutexLock lock(mutex_);
  entries_[id] = {.heard = now, .resident_at_begin = resident_bytes};
}

void RunningJobs::SetAttempt(const std::string& id, std::int32_t attempt) {
  MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  if (found != entries_.end()) found->second.attempt = attempt;
}

void RunningJobs::SetClaim(const std::string& id, std::uint64_t claim) {
  MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  if (found != entries_.end()) found->second.claim = claim;
}

void RunningJobs::OnProgress(const std::string& id,
                             const JobProgress& progress) {
  const absl::Duration now = clock_();
  MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  if (found == entries_.end()) return;
  found->second.heard = now;
  found->second.progress = progress;
}

std::vector<LeasedJob> RunningJobs::Leased() const {
  std::vector<LeasedJob> leased;
  MutexLock lock(mutex_);
  for (const auto& [id, entry] : entries_) {
    if (entry.claim != 0) leased.push_back({id, entry.claim, entry.progress});
  }
  return leased;
}

std::uint64_t RunningJobs::ClaimOf(const std::string& id) const {
  MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  return found == entries_.end() ? 0 : found->second.claim;
}

void RunningJobs::OnAskedToStop(const std::string& id, ResidentBytes resident) {
  const absl::Duration now = clock_();
  MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  if (found == entries_.end() || found->second.asked) return;
  found->second.asked = now;
  found->second.resident_when_asked = resident;
}

bool RunningJobs::WasAskedToStop(const std::string& id) const {
  MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  return found != entries_.end() && found->second.asked.has_value();
}

bool RunningJobs::SetStuck(const std::string& id) {
  MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  if (found == entries_.end()) return false;
  Entry& entry = found->second;
  if (entry.is_stuck || !entry.asked) return false;
  entry.is_stuck = true;
  return true;
}

RunningJobs::ResidentBytes RunningJobs::ResidentWhenAsked(
    const std::string& id) const {
  MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  if (found == entries_.end()) return std::nullopt;
  return found->second.resident_when_asked;
}

bool RunningJobs::End(const std::string& id) {
  MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  if (found == entries_.end()) return false;
  const bool was_stuck = found->second.is_stuck;
  entries_.erase(found);
  return was_stuck;
}

bool RunningJobs::IsEmpty() const {
  MutexLock lock(mutex_);
  return entries_.empty();
}

std::vector<JobTrace> RunningJobs::Traces() const {
  const absl::Duration now = clock_();
  std::vector<JobTrace> traces;
  MutexLock lock(mutex_);
  for (const auto& [id, entry] : entries_) {
    traces.push_back({.id = id,
                      .attempt = entry.attempt,
                      .silent = now - entry.heard,
                      .is_stuck = entry.is_stuck,
                      .resident_at_begin = entry.resident_at_begin});
    if (entry.asked) traces.back().unanswered = now - *entry.asked;
  }
  return traces;
}

std::vector<std::string> RunningJobs::Ids() const {
  std::vector<std::string> ids;
  MutexLock lock(mutex_);
  for (const auto& [id, entry] : entries_) {
    if (!entry.is_stuck) ids.push_back(id);
  }
  return ids;
}

std::vector<std::string> RunningJobs::Unanswered(absl::Duration grace) const {
  const absl::Duration now = clock_();
  std::vector<std::string> ids;
  MutexLock lock(mutex_);
  for (const auto& [id, entry] : entries_) {
    if (entry.is_stuck || !entry.asked) continue;
    if (now - *entry.asked >= grace) ids.push_back(id);
  }
  return ids;
}

}  // namespace isomatch
