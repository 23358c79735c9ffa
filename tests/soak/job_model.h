#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "isomatch/v1/service.pb.h"
#include "tests/soak/known_jobs.h"

namespace isomatch {

/// How often whatever is behind the API was restarted, in whole or in part.
struct Restarts {
  int begun = 0;
  int over = 0;
};

/// What is promised of jobs.
struct JobRules {
  /// After so many attempts a job may be CRASHED_REPEATEDLY.
  std::uint32_t least_attempts = 10;
  /// A restart takes back what ran before it: at once, or some time later.
  bool goes_back_later = false;
  /// A restart takes back what was shown in the last moment before it of how
  /// jobs started and went on, with its sequence.
  bool loses_last_moment = false;
  /// A mesh goes with the last job that names it. Otherwise it may stay.
  bool forgets_meshes_at_once = true;
};

/// A job as a client knows it that sees every answer.
struct ModelJob {
  v1::CreateJobRequest request;
  /// Of KnownJobs; none for a job whose result nobody knows.
  std::optional<int> kind;
  /// Jobs were created in this order.
  int number = 0;
  /// The newest answer, and the restarts that were over before it.
  v1::Job last;
  int restarts = 0;
  /// Restarts that were over before the attempt that runs began: what was begun
  /// after them may take it back.
  int restarts_before = 0;
  /// CancelJob was called while it was not known to be terminal.
  bool cancel_asked = false;
};

/// What one tenant's part of the server must look like, in memory. Jobs run
/// when they want to: the model says which answers are right, not which comes.
/// Functions return what is wrong, nothing when all is right.
class JobModel {
 public:
  JobModel(std::string tenant, const KnownJobs* known, JobRules rules)
      : tenant_(std::move(tenant)), known_(known), rules_(rules) {}

  using Problem = std::string;

  /// Takes up a job that was created just now.
  Problem Add(const v1::CreateJobRequest& request, std::optional<int> kind,
              int number, const v1::Job& job);
  /// Forgets a job, and meshes that no other one names.
  void Remove(const std::string& name);

  /// Whether the server has a mesh.
  enum class Presence { kMissing, kMaybe, kThere };
  Presence PresenceOf(const std::string& sha256) const;
  void AddMesh(const std::string& sha256) { meshes_.insert(sha256); }

  /// Compares an answer about a job with all before, and keeps it.
  Problem Observe(const v1::Job& now, Restarts restarts);

  /// Compares a whole list, all pages after one another: the newest first, each
  /// once, none left out. Only jobs created before that of `before`.
  Problem CompareList(const v1::ListJobsRequest& filter, int before,
                      const std::vector<v1::Job>& listed, Restarts restarts);

  /// Null when there is none.
  ModelJob* Find(const std::string& name);
  ModelJob* FindRequest(const std::string& request_id);
  /// Some job; null when there is none.
  ModelJob* Pick(std::uint64_t random);

  const std::map<int, ModelJob>& jobs() const { return jobs_; }

 private:
  Problem CompareIdentity(const ModelJob& job, const v1::Job& now) const;
  Problem CompareProgress(const ModelJob& job, const v1::Job& now,
                          bool may_go_back) const;
  Problem CompareEnd(const ModelJob& job, const v1::Job& now) const;

  const std::string tenant_;
  const KnownJobs* const known_;
  const JobRules rules_;
  /// By number.
  std::map<int, ModelJob> jobs_;
  std::map<std::string, int> by_name_;
  /// SHA-256 of what the server must have, and of what it may have.
  std::set<std::string> meshes_;
  std::set<std::string> forgotten_meshes_;
};

}  // namespace isomatch
