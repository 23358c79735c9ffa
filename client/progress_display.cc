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
      return absl::AsciiStrToLower(
          v1::Job::State_Name(job.state()).substr(sizeof("STATE_") - 1));
  }
}

std::string Bar(double fraction) {
  const int full = static_cast<int>(kBarWidth * std::clamp(fraction, 0.0, 1.0));
  return absl::StrCat(
      "[", std::string(static_cast<std::size_t>(full), '#'),
      std::string(static_cast<std::size_t>(kBarWidth - full), '.'), "]");
}

}  // namespace

std::string StageLabel(v1::Stage stage) {
  const std::string name = v1::Stage_Name(stage);
  if (stage == v1::STAGE_UNSPECIFIED || name.empty()) return "starting";
  return absl::StrReplaceAll(
      absl::AsciiStrToLower(name.substr(sizeof("STAGE_") - 1)), {{"_", " "}});
}

void ProgressDisplay::Show(const v1::Job& job, absl::Time now) {
  if (style_ == ProgressStyle::kNone) return;
  const std::string label = Label(job);
  const double fraction = job.progress().total_fraction();
  const std::string percent = absl::StrFormat("%3.0f %%", 100 * fraction);
  if (style_ == ProgressStyle::kBar) {
    out_ << kClearLine << Bar(fraction) << " " << percent << "  " << label
         << std::flush;
    drawn_ = true;
    return;
  }
  if (label == last_label_ && now - last_line_ < kLineInterval) return;
  last_label_ = label;
  last_line_ = now;
  out_ << percent << "  " << label << std::endl;
}

void ProgressDisplay::Clear() {
  if (drawn_) out_ << kClearLine << std::flush;
}

}  // namespace isomatch
