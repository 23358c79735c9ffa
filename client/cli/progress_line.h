#pragma once

#include <optional>
#include <ostream>
#include <string>

#include "absl/time/clock.h"
#include "absl/time/time.h"

namespace isomatch {

/// How progress is told.
enum class ProgressStyle {
  kNone,
  /// A line when the label changes, and every few seconds.
  kLines,
  /// One line that is drawn anew, for terminals.
  kBar,
};

/// What suits a standard error that is a terminal or not; `quiet` says nothing.
ProgressStyle ProgressStyleFor(bool is_interactive, bool quiet);

/// "45 s", "3 min", "2 h": a length of time, for people.
std::string FormatLeft(absl::Duration left);

/// How far something is.
struct ProgressNews {
  /// Done, in [0, 1].
  double fraction = 0;
  /// What is being done.
  std::string label;
  /// What is told beside the label, but is no reason for a line.
  std::string detail;
  /// False while the fraction waits, which is not counted in the time left.
  bool is_running = true;
};

/// Tells the user how far something is: fraction, time left, label. Not
/// thread-safe.
class ProgressLine {
 public:
  /// Keeps a reference to `out`.
  ProgressLine(std::ostream& out, ProgressStyle style)
      : out_(out), style_(style) {}

  /// Leaves the terminal's line clean.
  ~ProgressLine();

  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  void Show(const ProgressNews& news, absl::Time now = absl::Now());

 private:
  /// What is left at the speed since it was first seen running; nullopt while
  /// that says nothing.
  std::optional<absl::Duration> Left(const ProgressNews& news, absl::Time now);

  std::ostream& out_;
  ProgressStyle style_;
  std::string last_label_;
  absl::Time last_line_ = absl::InfinitePast();
  bool drawn_ = false;
  /// When it was first seen running, and how far it was.
  absl::Time first_seen_ = absl::InfiniteFuture();
  double first_fraction_ = 0;
};

}  // namespace isomatch
