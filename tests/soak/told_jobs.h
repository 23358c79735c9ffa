#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "isomatch/v1/service.pb.h"
#include "tests/soak/known_jobs.h"
#include "tests/soak/soak_server.h"

namespace isomatch {

/// What a client does that sends jobs, looks at them, cancels and deletes them,
/// as chance says, and what it was told: that must hold ever after, whatever
/// happens to the servers. Each problem fails the test. Not thread-safe.
class ToldJobs {
 public:
  /// A job may be CRASHED_REPEATEDLY after `least_attempts`.
  ToldJobs(std::uint64_t seed, std::uint32_t least_attempts)
      : least_attempts_(least_attempts), random_(seed) {}

  /// One call; false when the server is gone. `where` is for messages.
  bool Step(Stub& stub, const std::string& where);

  /// Waits for the end of all jobs, and downloads every result. REQUIRES: the
  /// server stays.
  void CheckAtTheEnd(Stub& stub);

  /// Returns the name of a job that is not known to be over; empty for none.
  std::string OpenJob();

  int sent() const { return static_cast<int>(sent_.size()); }
  /// Those that were not deleted.
  int there() const;
  int lost() const { return lost_; }
  int wrong() const { return wrong_; }
  /// Jobs that ended as CRASHED_REPEATEDLY.
  int given_up() const { return given_up_; }

  int Random(int bound) {
    return std::uniform_int_distribution<int>(0, bound - 1)(random_);
  }

 private:
  static constexpr int kKinds = 24;
  static constexpr int kMostOpen = 12;

  /// What a client knows of a request it sent.
  struct Sent {
    v1::CreateJobRequest request;
    int kind = 0;
    /// Empty while no answer came: then the same request is sent again.
    std::string name = {};
    /// Asked for, whether or not an answer came.
    bool cancel_asked = false;
    bool delete_asked = false;
    /// Terminal, as an answer said; UNSPECIFIED before.
    v1::Job::State end = v1::Job::STATE_UNSPECIFIED;
    bool is_deleted = false;
  };

  // One call each; false when the server is gone.
  bool Send(Stub& stub, Sent& sent);
  bool Look(Stub& stub, Sent& sent);
  bool Cancel(Stub& stub, Sent& sent);
  bool Delete(Stub& stub, Sent& sent);

  void Compare(const v1::Job& job, Sent& sent);
  void CompareFailed(const v1::Job& job);
  void CompareResult(Stub& stub, const Sent& sent);
  void CompareList(Stub& stub, std::size_t there);
  int CountOpen() const;

  const std::uint32_t least_attempts_;
  std::mt19937_64 random_;
  const KnownJobs known_{kKinds};
  std::vector<Sent> sent_;
  std::string where_;
  int lost_ = 0;
  int wrong_ = 0;
  int given_up_ = 0;
};

}  // namespace isomatch
