#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "core/base/file_descriptor.h"

namespace isomatch {

/// What a job that has a worker was last seen doing.
struct JobTrace {
  std::string id;
  std::int32_t attempt = 0;
  /// Since it began or last told of its progress.
  absl::Duration silent = absl::ZeroDuration();
  /// Since it was asked to stop; not set when it was not.
  std::optional<absl::Duration> unanswered = std::nullopt;
  /// Its worker was given up.
  bool is_stuck = false;
  /// Resident bytes of the process when the job began.
  std::int64_t resident_at_begin = 0;
};

/// What a process was last seen doing.
struct ProcessTrace {
  std::int64_t resident_bytes = 0;
  /// What it may have with all that it has reserved.
  std::int64_t expected_bytes = 0;
  std::vector<JobTrace> jobs;
};

/// Where the trace of a process outlives it, so that the next one can tell
/// which job took it down. Called by one thread at a time.
class TraceStore {
 public:
  virtual ~TraceStore() = default;

  /// Returns what the process before wrote last; an empty trace when nothing
  /// can be read.
  virtual ProcessTrace Read() = 0;

  /// Takes the place of what was written before. A trace is a help, no record:
  /// errors are ignored.
  virtual void Write(const ProcessTrace& trace) = 0;
};

/// One JSON object in a file. It is never synchronized: it survives the end of
/// the process, however sudden, but not that of the machine, which is no job's
/// fault.
class TraceFile : public TraceStore {
 public:
  /// Makes the file if need be, only its owner can read it. When it cannot be
  /// opened nothing is kept.
  explicit TraceFile(std::string path);

  ProcessTrace Read() override;
  void Write(const ProcessTrace& trace) override;

 private:
  const std::string path_;
  const FileDescriptor file_;
  /// Bytes of the longest trace that was written.
  std::size_t size_ = 0;
};

}  // namespace isomatch
