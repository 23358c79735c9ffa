#pragma once

#include <map>
#include <string>
#include <vector>

#include "isomatch/v1/service.pb.h"
#include "tests/soak/soak_server.h"

namespace isomatch {

/// Jobs of 5 to 50 ms, each with meshes of its own, and what each gives:
/// the same request always gives the same bytes, so what a server without
/// trouble gave is right for ever.
class KnownJobs {
 public:
  /// Runs each of `count` jobs once, on a server of its own.
  explicit KnownJobs(int count);

  int count() const { return static_cast<int>(requests_.size()); }
  const v1::CreateJobRequest& request(int kind) const {
    return requests_.at(static_cast<size_t>(kind));
  }
  using Parts = std::map<v1::ResultPart, std::string>;
  const Parts& parts(int kind) const {
    return parts_.at(static_cast<size_t>(kind));
  }

  /// Says what is wrong with the result that a SUCCEEDED job tells of; empty
  /// when nothing.
  std::string ProblemOf(int kind, const v1::Job& job) const;
  /// Downloads every part and says what is wrong.
  std::string ProblemOfDownload(int kind, Stub& stub, const std::string& name,
                                const std::string& key = "") const;

 private:
  std::vector<v1::CreateJobRequest> requests_;
  std::vector<Parts> parts_;
};

/// A job that takes most of a minute: 10,242 vertices, as the paper does it.
v1::CreateJobRequest LongJob();

/// Returns one that was never used before.
std::string UniqueRequestId();

}  // namespace isomatch
