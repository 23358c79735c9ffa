#pragma once

#include <optional>
#include <ostream>
#include <string>

#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "isomatch/v1/service.pb.h"

namespace isomatch {

/// How progress is told.
enum class ProgressStyle {
  kNone,
  /// A line when the stage changes, and every few seconds.
  kLines,
  /// One line that is drawn anew, for terminals.
  kBar,
};

/// What suits a standard error that is a terminal or not; `quiet` says nothing.
ProgressStyle ProgressStyleFor(bool is_interactive, bool quiet);

/// "first insertion" for STAGE_FIRST_INSERTION.
std::string StageLabel(v1::Stage stage);

/// "queued" for STATE_QUEUED.
std::string StateLabel(v1::Job::State state);

/// "45 s", "3 min", "2 h": what is left of something, for people.
std::string FormatLeft(absl::Duration left);

/// Tells the user how far a job is: fraction, time left, stage. Not
/// thread-safe.
class ProgressDisplay {
 public:
  /// Keeps a reference to `out`.
  ProgressDisplay(std::ostream& out, ProgressStyle style)
      : out_(out), style_(style) {}

  /// Leaves the terminal's line clean.
  ~ProgressDisplay() { Clear(); }

  ProgressDisplay(const ProgressDisplay&) = delete;
  ProgressDisplay& operator=(const ProgressDisplay&) = delete;

  void Show(const v1::Job& job) { Show(job, absl::Now()); }
  void Show(const v1::Job& job, absl::Time now);

 private:
  void Clear();

  // What is left at the job's speed since it was first seen running; nullopt
  // while that says nothing.
  std::optional<absl::Duration> Left(const v1::Job& job, absl::Time now);

  std::ostream& out_;
  ProgressStyle style_;
  std::string last_label_;
  absl::Time last_line_ = absl::InfinitePast();
  bool drawn_ = false;
  // When the job was first seen running, and how far it was.
  absl::Time first_seen_ = absl::InfiniteFuture();
  double first_fraction_ = 0;
};

}  // namespace isomatch
