#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "isomatch/v1/service.pb.h"
#include "tests/soak/known_jobs.h"

namespace isomatch {

/// A job as a client knows it that sees every answer.
struct ModelJob {
  v1::CreateJobRequest request;
  /// Of KnownJobs; none for a job whose result nobody knows.
  std::optional<int> kind;
  /// Jobs were created in this order.
  int number = 0;
  /// The newest answer, and the server's restarts before it.
  v1::Job last;
  int restarts = 0;
  /// CancelJob was called while it was not known to be terminal.
  bool cancel_asked = false;
};

/// What one tenant's part of the server must look like, in memory. Jobs run
/// when they want to: the model says which answers are right, not which comes.
/// Functions return what is wrong, nothing when all is right.
class JobModel {
 public:
  JobModel(std::string tenant, const KnownJobs* known)
      : tenant_(std::move(tenant)), known_(known) {}

  using Problem = std::string;

  /// Takes up a job that was created just now.
  Problem Add(const v1::CreateJobRequest& request, std::optional<int> kind,
              int number, const v1::Job& job);
  void Remove(const std::string& name);

  /// Compares an answer about a job with all before, and keeps it.
  Problem Observe(const v1::Job& now, int restarts);

  /// Compares a whole list, all pages after one another: the newest first, each
  /// once, none left out. Only jobs created before that of `before`.
  Problem CompareList(const v1::ListJobsRequest& filter, int before,
                      const std::vector<v1::Job>& listed, int restarts);

  /// Null when there is none.
  ModelJob* Find(const std::string& name);
  ModelJob* FindRequest(const std::string& request_id);
  /// Some job; null when there is none.
  ModelJob* Pick(std::uint64_t random);

  const std::map<int, ModelJob>& jobs() const { return jobs_; }

  /// SHA-256 of the meshes that the server must have.
  std::set<std::string> meshes;

 private:
  Problem CompareIdentity(const ModelJob& job, const v1::Job& now) const;
  Problem CompareProgress(const ModelJob& job, const v1::Job& now,
                          bool restarted) const;
  Problem CompareEnd(const ModelJob& job, const v1::Job& now) const;

  const std::string tenant_;
  const KnownJobs* const known_;
  /// By number.
  std::map<int, ModelJob> jobs_;
  std::map<std::string, int> by_name_;
};

}  // namespace isomatch
