#pragma once

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

/// "first insertion" for STAGE_FIRST_INSERTION.
std::string StageLabel(v1::Stage stage);

/// Tells the user how far a job is. Not thread-safe.
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

  std::ostream& out_;
  ProgressStyle style_;
  std::string last_label_;
  absl::Time last_line_ = absl::InfinitePast();
  bool drawn_ = false;
};

}  // namespace isomatch
