#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"

namespace isomatch::bench {

struct QueueSelection {
  /// Threads that claim jobs, each as a worker of its own.
  std::vector<int> workers = {1, 2, 4, 8, 16};
  /// How long a worker holds a job instead of computing, seconds.
  double job_seconds = 0;
  /// Jobs for each number of workers.
  int jobs = 4000;
  /// Jobs that wait while CreateJob is timed.
  int queued = 10000;
  /// Jobs that pass through the queue while its table's size is watched.
  int passing = 100000;
  /// Whether the database waits for its disk, as it does by default.
  bool fsync = true;
  /// Whether workers reach the database by an Ethernet of their own.
  bool namespaces = false;
};

/// Prints what a queue on PostgreSQL can do, on a server of its own:
///
///   1. claims and fenced ends a second by many workers at once, without and
///      with a time for each job, and the database's processor time a job;
///   2. how long a CreateJob call of a gateway takes while many jobs wait;
///   3. how large the table of live jobs is after many have passed.
///
/// The same as JSON to `out_path` unless that is empty.
absl::Status RunQueue(const QueueSelection& selection,
                      const std::string& out_path);

}  // namespace isomatch::bench
