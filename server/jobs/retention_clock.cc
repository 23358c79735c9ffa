#include "server/jobs/retention_clock.h"

#include <algorithm>

#include "absl/strings/str_cat.h"

namespace isomatch {
namespace {

/// How far what was saved may be behind.
constexpr absl::Duration kSaveAgain = absl::Minutes(10);

std::string Away(absl::Duration by, const char* of_what) {
  return absl::StrCat("the clock is ",
                      absl::FormatDuration(
                          absl::Trunc(absl::AbsDuration(by), absl::Seconds(1))),
                      by < absl::ZeroDuration() ? " behind " : " ahead of ",
                      of_what, "; until it has been steady for ",
                      absl::FormatDuration(RetentionClock::kGrace),
                      " jobs age by the time that the server runs");
}

}  // namespace

RetentionClock::RetentionClock(Environment environment,
                               std::optional<absl::Time> last_seen)
    : environment_(std::move(environment)), saved_(last_seen) {
  MutexLock lock(mutex_);
  last_ = Read();
  believed_ = last_.wall;
  if (!last_seen || absl::AbsDuration(last_.wall - *last_seen) <= kJump) return;
  believed_ = *last_seen;
  steady_since_ = last_.steady;
  at_start_ = Away(last_.wall - *last_seen, "what the server last saw");
}

std::string RetentionClock::Look(const Reading& now) {
  std::string say = std::exchange(at_start_, "");
  const absl::Duration passed = now.steady - last_.steady;
  const absl::Duration jump = (now.wall - last_.wall) - passed;
  last_ = now;
  believed_ += passed;
  if (absl::AbsDuration(jump) > kJump) {
    steady_since_ = now.steady;
    return Away(jump, "where it was");
  }
  if (steady_since_ && now.steady - *steady_since_ >= kGrace) {
    steady_since_.reset();
    say = "the clock is believed again: old jobs are deleted";
  }
  if (!steady_since_) believed_ = now.wall;
  return say;
}

RetentionClock::Bounds RetentionClock::LookNow() {
  const Reading now = Read();
  std::string say;
  bool is_believed = false;
  bool save = false;
  absl::Time believed;
  {
    MutexLock lock(mutex_);
    say = Look(now);
    is_believed = !steady_since_.has_value();
    believed = believed_;
    save = !saved_ || absl::AbsDuration(believed - *saved_) >= kSaveAgain;
    if (save) saved_ = believed;
  }
  if (!say.empty()) environment_.on_change(is_believed, say);
  if (save) environment_.save(believed);
  return {std::min(now.wall, believed), std::max(now.wall, believed)};
}

}  // namespace isomatch
