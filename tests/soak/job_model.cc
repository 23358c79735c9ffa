#include "tests/soak/job_model.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include <google/protobuf/util/message_differencer.h>

#include "absl/strings/str_cat.h"
#include "core/base/sha256.h"

namespace isomatch {
namespace {

using google::protobuf::util::MessageDifferencer;

bool HasLabels(const v1::CreateJobRequest& request,
               const v1::ListJobsRequest& filter) {
  return std::all_of(
      filter.labels().begin(), filter.labels().end(), [&](const auto& label) {
        const auto found = request.labels().find(label.first);
        return found != request.labels().end() && found->second == label.second;
      });
}

bool HasState(const v1::ListJobsRequest& filter, v1::Job::State state) {
  return filter.states_size() == 0 ||
         std::count(filter.states().begin(), filter.states().end(), state) > 0;
}

/// SHA-256 of the meshes of a request.
std::set<std::string> MeshesOf(const v1::CreateJobRequest& request) {
  const auto of = [](const v1::Mesh& mesh) {
    return mesh.has_digest() ? mesh.digest().sha256() : Sha256Hex(mesh.draco());
  };
  return {of(request.mesh_x()), of(request.mesh_y())};
}

/// Whether the list has to have the job: it cannot have left these states.
bool MustBeListed(const ModelJob& job, const v1::ListJobsRequest& filter) {
  return HasLabels(job.request, filter) &&
         (filter.states_size() == 0 ||
          (IsEnd(job.last.state()) && HasState(filter, job.last.state())));
}

}  // namespace

JobModel::Problem JobModel::Add(const v1::CreateJobRequest& request,
                                std::optional<int> kind, int number,
                                const v1::Job& job) {
  if (by_name_.count(job.name()) != 0) return job.name() + " came twice";
  by_name_[job.name()] = number;
  ModelJob& added = jobs_[number];
  added.request = request;
  added.kind = kind;
  added.number = number;
  added.last.set_name(job.name());
  added.last.set_state(v1::Job::STATE_QUEUED);
  *added.last.mutable_create_time() = job.create_time();
  return "";
}

void JobModel::Remove(const std::string& name) {
  const auto job = jobs_.find(by_name_.at(name));
  const std::set<std::string> meshes = MeshesOf(job->second.request);
  jobs_.erase(job);
  by_name_.erase(name);
  for (const std::string& mesh : meshes) {
    const bool is_named = std::ranges::any_of(jobs_, [&](const auto& other) {
      return MeshesOf(other.second.request).count(mesh) > 0;
    });
    if (is_named || meshes_.erase(mesh) == 0) continue;
    if (!rules_.forgets_meshes_at_once) forgotten_meshes_.insert(mesh);
  }
}

JobModel::Presence JobModel::PresenceOf(const std::string& sha256) const {
  if (meshes_.count(sha256) > 0) return Presence::kThere;
  return forgotten_meshes_.count(sha256) > 0 ? Presence::kMaybe
                                             : Presence::kMissing;
}

ModelJob* JobModel::Find(const std::string& name) {
  const auto found = by_name_.find(name);
  return found == by_name_.end() ? nullptr : &jobs_.at(found->second);
}

ModelJob* JobModel::FindRequest(const std::string& request_id) {
  for (auto& [number, job] : jobs_) {
    if (job.request.request_id() == request_id) return &job;
  }
  return nullptr;
}

ModelJob* JobModel::Pick(std::uint64_t random) {
  if (jobs_.empty()) return nullptr;
  return &std::next(jobs_.begin(),
                    static_cast<std::int64_t>(random % jobs_.size()))
              ->second;
}

JobModel::Problem JobModel::CompareIdentity(const ModelJob& job,
                                            const v1::Job& now) const {
  v1::Job expected;
  expected.set_name(job.last.name());
  expected.set_tenant(tenant_);
  expected.set_request_id(job.request.request_id());
  expected.set_priority(job.request.priority());
  *expected.mutable_labels() = job.request.labels();
  *expected.mutable_create_time() = job.last.create_time();
  v1::Job found;
  found.set_name(now.name());
  found.set_tenant(now.tenant());
  found.set_request_id(now.request_id());
  found.set_priority(now.priority());
  *found.mutable_labels() = now.labels();
  *found.mutable_create_time() = now.create_time();
  if (MessageDifferencer::Equals(expected, found)) return "";
  return absl::StrCat("is ", found.ShortDebugString(), ", expected ",
                      expected.ShortDebugString());
}

JobModel::Problem JobModel::CompareProgress(const ModelJob& job,
                                            const v1::Job& now,
                                            bool may_go_back) const {
  if (IsEnd(job.last.state())) {
    return MessageDifferencer::Equals(job.last, now)
               ? ""
               : "changed although it was terminal";
  }
  const bool may_fall = may_go_back && rules_.loses_last_moment;
  if (now.sequence() < job.last.sequence() && !may_fall) return "sequence fell";
  if (may_go_back) return "";
  if (now.state() < job.last.state()) return "state went back";
  if (now.attempt() < job.last.attempt()) return "attempt fell";
  if (now.progress().total_fraction() < job.last.progress().total_fraction()) {
    return "progress fell";
  }
  return "";
}

JobModel::Problem JobModel::CompareEnd(const ModelJob& job,
                                       const v1::Job& now) const {
  const std::string& reason = now.error().reason();
  switch (now.state()) {
    case v1::Job::STATE_SUCCEEDED:
      return job.kind ? known_->ProblemOf(*job.kind, now) : "";
    case v1::Job::STATE_CANCELLED:
      return job.cancel_asked ? "" : "cancelled by nobody";
    case v1::Job::STATE_FAILED:
      if (reason == "QUEUE_TIMEOUT" && job.request.has_queue_timeout()) {
        return "";
      }
      if (reason == "RUN_TIMEOUT" && job.request.has_run_timeout()) return "";
      if (reason == "CRASHED_REPEATEDLY" &&
          now.attempt() >= rules_.least_attempts)
        return "";
      return "failed without a reason to";
    default:
      return now.error().reason().empty() && !now.has_result()
                 ? ""
                 : "has error or result although it is not terminal";
  }
}

JobModel::Problem JobModel::Observe(const v1::Job& now, Restarts restarts) {
  ModelJob* const job = Find(now.name());
  if (job == nullptr) return "not there: " + now.ShortDebugString();
  Problem problem = CompareIdentity(*job, now);
  if (problem.empty()) {
    problem = CompareProgress(*job, now, job->restarts_before < restarts.begun);
  }
  if (problem.empty()) problem = CompareEnd(*job, now);
  if (!problem.empty()) {
    return absl::StrCat(problem, ": ", now.ShortDebugString(), " after ",
                        job->last.ShortDebugString());
  }
  if (!rules_.goes_back_later || now.state() == v1::Job::STATE_QUEUED) {
    job->restarts_before = restarts.over;
  } else if (now.attempt() != job->last.attempt()) {
    job->restarts_before = job->restarts;
  }
  job->last = now;
  job->restarts = restarts.over;
  return "";
}

JobModel::Problem JobModel::CompareList(const v1::ListJobsRequest& filter,
                                        int before,
                                        const std::vector<v1::Job>& listed,
                                        Restarts restarts) {
  auto next = listed.begin();
  for (auto job = jobs_.rbegin(); job != jobs_.rend(); ++job) {
    if (job->first >= before) continue;
    const bool is_next =
        next != listed.end() && next->name() == job->second.last.name();
    if (!is_next) {
      if (!MustBeListed(job->second, filter)) continue;
      return absl::StrCat(
          "left out: ", job->second.last.ShortDebugString(),
          ", came: ", next == listed.end() ? "none" : next->ShortDebugString());
    }
    const bool fits = HasLabels(job->second.request, filter) &&
                      HasState(filter, next->state());
    if (!fits) return "listed wrongly: " + next->ShortDebugString();
    Problem problem = Observe(*next, restarts);
    if (!problem.empty()) return problem;
    ++next;
  }
  return next == listed.end() ? ""
                              : "gone, twice, too new or out of order: " +
                                    next->ShortDebugString();
}

}  // namespace isomatch
