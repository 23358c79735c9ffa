#include "client/progress_display.h"

#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"

namespace isomatch {
namespace {

constexpr absl::Duration kLineInterval = absl::Seconds(5);
constexpr int kBarWidth = 30;
constexpr char kClearLine[] = "\r\x1b[K";

std::string Label(const v1::Job& job) {
  switch (job.state()) {
    case v1::Job::STATE_QUEUED:
      return absl::StrCat("queued, ", job.queue_position(), " ahead");
    case v1::Job::STATE_RUNNING:
      return StageLabel(job.progress().stage());
    default:
      return StateLabel(job.state());
  }
}

std::string Bar(double fraction) {
  const int full = static_cast<int>(kBarWidth * std::clamp(fraction, 0.0, 1.0));
  return absl::StrCat(
      "[", std::string(static_cast<std::size_t>(full), '#'),
      std::string(static_cast<std::size_t>(kBarWidth - full), '.'), "]");
}

}  // namespace

ProgressStyle ProgressStyleFor(bool is_interactive, bool quiet) {
  if (quiet) return ProgressStyle::kNone;
  return is_interactive ? ProgressStyle::kBar : ProgressStyle::kLines;
}

std::string FormatLeft(absl::Duration left) {
  if (left < absl::Minutes(2)) {
    return absl::StrFormat("%.0f s", absl::ToDoubleSeconds(left));
  }
  if (left < absl::Hours(2)) {
    return absl::StrFormat("%.0f min", absl::ToDoubleMinutes(left));
  }
  return absl::StrFormat("%.0f h", absl::ToDoubleHours(left));
}

std::string StageLabel(v1::Stage stage) {
  const std::string name = v1::Stage_Name(stage);
  if (stage == v1::STAGE_UNSPECIFIED || name.empty()) return "starting";
  return absl::StrReplaceAll(
      absl::AsciiStrToLower(name.substr(sizeof("STAGE_") - 1)), {{"_", " "}});
}

std::string StateLabel(v1::Job::State state) {
  return absl::AsciiStrToLower(
      v1::Job::State_Name(state).substr(sizeof("STATE_") - 1));
}

std::optional<absl::Duration> ProgressDisplay::Left(const v1::Job& job,
                                                    absl::Time now) {
  constexpr absl::Duration kEnoughTime = absl::Seconds(1);
  constexpr double kEnoughProgress = 0.05;
  if (job.state() != v1::Job::STATE_RUNNING) return std::nullopt;
  const double fraction = job.progress().total_fraction();
  if (first_seen_ == absl::InfiniteFuture()) {
    first_seen_ = now;
    first_fraction_ = fraction;
  }
  const absl::Duration elapsed = now - first_seen_;
  const double done = fraction - first_fraction_;
  if (elapsed < kEnoughTime || done < kEnoughProgress) return std::nullopt;
  return elapsed * ((1 - fraction) / done);
}

void ProgressDisplay::Show(const v1::Job& job, absl::Time now) {
  if (style_ == ProgressStyle::kNone) return;
  const std::string label = Label(job);
  const std::optional<absl::Duration> left = Left(job, now);
  const std::string rest =
      left ? absl::StrCat(", about ", FormatLeft(*left), " left") : "";
  const double fraction = job.progress().total_fraction();
  const std::string percent = absl::StrFormat("%3.0f %%", 100 * fraction);
  if (style_ == ProgressStyle::kBar) {
    out_ << kClearLine << Bar(fraction) << " " << percent << "  " << label
         << rest << std::flush;
    drawn_ = true;
    return;
  }
  if (label == last_label_ && now - last_line_ < kLineInterval) return;
  last_label_ = label;
  last_line_ = now;
  out_ << percent << "  " << label << rest << std::endl;
}

void ProgressDisplay::Clear() {
  if (drawn_) out_ << kClearLine << std::flush;
}

}  // namespace isomatch
