#include "server/jobs/retention_clock.h"

#include "absl/strings/str_cat.h"

namespace isomatch {
namespace {

/// How far what was saved may be behind.
constexpr absl::Duration kSaveAgain = absl::Minutes(10);

std::string Ahead(absl::Duration by, const char* of_what) {
  return absl::StrCat(
      "the clock is ", absl::FormatDuration(absl::Trunc(by, absl::Seconds(1))),
      of_what, "; no job is deleted for its age until it has been steady for ",
      absl::FormatDuration(RetentionClock::kGrace));
}

}  // namespace

RetentionClock::RetentionClock(Parts parts, std::optional<absl::Time> last_seen)
    : parts_(std::move(parts)), saved_(last_seen) {
  MutexLock lock(mutex_);
  last_ = Read();
  if (!last_seen || last_.wall - *last_seen <= kJump) return;
  steady_since_ = last_.steady;
  at_start_ =
      Ahead(last_.wall - *last_seen, " ahead of what the server last saw");
}

std::string RetentionClock::Look(const Reading& now) {
  std::string say = std::exchange(at_start_, "");
  const absl::Duration jump =
      (now.wall - last_.wall) - (now.steady - last_.steady);
  last_ = now;
  if (absl::AbsDuration(jump) > kJump) {
    steady_since_ = now.steady;
    return Ahead(jump, " away from where it was");
  }
  if (steady_since_ && now.steady - *steady_since_ >= kGrace) {
    steady_since_.reset();
    return "the clock is believed again: old jobs are deleted";
  }
  return say;
}

bool RetentionClock::IsBelieved() {
  const Reading now = Read();
  std::string say;
  bool is_believed = false;
  bool save = false;
  {
    MutexLock lock(mutex_);
    say = Look(now);
    is_believed = !steady_since_.has_value();
    save = is_believed &&
           (!saved_ || absl::AbsDuration(now.wall - *saved_) >= kSaveAgain);
    if (save) saved_ = now.wall;
  }
  if (!say.empty()) parts_.on_change(is_believed, say);
  if (save) parts_.save(now.wall);
  return is_believed;
}

}  // namespace isomatch
