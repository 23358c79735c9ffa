#include "client/cli/progress_line.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace isomatch {
namespace {

constexpr absl::Duration kLineInterval = absl::Seconds(5);
constexpr int kBarWidth = 30;
constexpr char kClearLine[] = "\r\x1b[K";

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

ProgressLine::~ProgressLine() {
  if (drawn_) out_ << kClearLine << std::flush;
}

void ProgressLine::Show(const ProgressNews& news, absl::Time now) {
  if (style_ == ProgressStyle::kNone) return;
  const std::optional<absl::Duration> left = Left(news, now);
  std::string text = absl::StrFormat("%3.0f %%  %s%s", 100 * news.fraction,
                                     news.label, news.detail);
  if (left) absl::StrAppend(&text, ", about ", FormatLeft(*left), " left");
  if (style_ == ProgressStyle::kBar) {
    out_ << kClearLine << Bar(news.fraction) << " " << text << std::flush;
    drawn_ = true;
    return;
  }
  if (news.label == last_label_ && now - last_line_ < kLineInterval) return;
  last_label_ = news.label;
  last_line_ = now;
  out_ << text << std::endl;
}

std::optional<absl::Duration> ProgressLine::Left(const ProgressNews& news,
                                                 absl::Time now) {
  constexpr absl::Duration kEnoughTime = absl::Seconds(1);
  constexpr double kEnoughProgress = 0.05;
  if (!news.is_running || news.fraction >= 1) return std::nullopt;
  if (first_seen_ == absl::InfiniteFuture()) {
    first_seen_ = now;
    first_fraction_ = news.fraction;
  }
  const absl::Duration elapsed = now - first_seen_;
  const double done = news.fraction - first_fraction_;
  if (elapsed < kEnoughTime || done < kEnoughProgress) return std::nullopt;
  return elapsed * ((1 - news.fraction) / done);
}

}  // namespace isomatch
