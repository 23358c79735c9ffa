#pragma once

#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "isomatch/v1/service.pb.h"
#include "tests/soak/known_jobs.h"

namespace isomatch {

/// What a client may ask for, as chance says: the same with the same seed. Not
/// thread-safe.
class RandomRequests {
 public:
  /// `known` outlives this object.
  RandomRequests(std::uint64_t seed, const KnownJobs* known);

  std::uint64_t Any() { return random_(); }
  int Below(int bound) {
    return std::uniform_int_distribution<int>(0, bound - 1)(random_);
  }
  bool OneIn(int times) { return Below(times) == 0; }

  struct NewJob {
    v1::CreateJobRequest request;
    /// Of KnownJobs; none for a job that takes longer.
    std::optional<int> kind;
  };
  /// Some have a request_id, which may be one of `free_request_ids`: it is
  /// taken from there.
  NewJob Job(std::vector<std::string>& free_request_ids);

  /// Of a list of jobs.
  v1::ListJobsRequest Filter();

  /// One that jobs use.
  const std::string& Mesh();

 private:
  std::mt19937_64 random_;
  const KnownJobs& known_;
  v1::CreateJobRequest slow_;
};

}  // namespace isomatch
