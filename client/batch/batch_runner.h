#pragma once

#include <functional>
#include <mutex>
#include <stop_token>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "client/api/call_retry.h"
#include "client/api/isomatch_client.h"
#include "client/batch/batch_list.h"
#include "client/batch/batch_record.h"
#include "client/batch/batch_table.h"
#include "client/job/job_options.h"

namespace isomatch {

/// How a batch is run.
struct BatchOptions {
  /// Where maps, reports and summary.csv go; exists.
  std::string folder;
  JobOptions job;
  /// Pairs at the same time.
  int parallel = 1;
  /// Runs pairs that are done already too.
  bool force = false;
  BatchParts parts;
};

/// How far a batch is.
struct BatchProgress {
  int total = 0;
  int ended = 0;
  int failed = 0;
  int running = 0;
  /// Progress of the whole batch, 0 to 1; running pairs count in part.
  double fraction = 0;
};

/// Matches the pairs of a batch with the help of a server.
class BatchRunner {
 public:
  using ProgressCallback = std::function<void(const BatchProgress&)>;

  /// `on_progress` is called from several threads, one at a time.
  BatchRunner(IsomatchClient* client, BatchOptions options,
              ProgressCallback on_progress)
      : client_(client),
        options_(std::move(options)),
        on_progress_(std::move(on_progress)) {}

  /// Returns a row for each pair, in order. A pair that fails does not stop the
  /// others; a server that is lost or refuses the caller does. Pairs that an
  /// earlier run finished are kept. summary.csv is written anew whenever a pair
  /// has ended, so that it is right also after a kill.
  std::vector<BatchRow> Run(const std::vector<BatchPair>& pairs,
                            const std::stop_token& stop);

  /// Why summary.csv could not be written, which ends a batch.
  const absl::Status& summary_status() const { return summary_status_; }

 private:
  void RunLoop(const std::vector<BatchPair>& pairs,
               const std::stop_token& stop);
  absl::Status RunPair(const BatchPair& pair, std::size_t index, BatchRow* row,
                       const std::stop_token& stop);
  absl::Status Match(const BatchPair& pair, std::size_t index,
                     BatchRecord* record, const std::stop_token& stop);
  void SetEnded(std::size_t index, BatchRow row, const absl::Status& status,
                const std::stop_token& stop);
  /// Sleeps for a while; false when the user wants to stop.
  bool Wait(Backoff* backoff);
  /// True when another pair is being matched and is not in Wait.
  bool OthersRun();
  /// REQUIRES: mutex_ is held.
  void Tell();

  IsomatchClient* const client_;
  const BatchOptions options_;
  const ProgressCallback on_progress_;

  std::mutex mutex_;
  std::size_t next_ = 0;
  /// Running pairs that are in Wait.
  int waiting_ = 0;
  bool is_over_ = false;
  absl::Status summary_status_;
  BatchProgress progress_;
  std::vector<BatchRow> rows_;
  /// Progress of each pair, 0 to 1.
  std::vector<double> fractions_;
};

}  // namespace isomatch
