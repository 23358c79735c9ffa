#include "client/progress_display.h"

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"

namespace isomatch {
namespace {

std::string Label(const v1::Job& job) {
  switch (job.state()) {
    case v1::Job::STATE_QUEUED:
      return absl::StrCat("queued, ", WaitLabel(job));
    case v1::Job::STATE_RUNNING:
      return StageLabel(job.progress().stage());
    default:
      return StateLabel(job.state());
  }
}

}  // namespace

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

std::string WaitLabel(const v1::Job& job) {
  switch (job.waiting_for()) {
    case v1::Job::WAIT_REASON_STORAGE:
      return "server's disk full";
    case v1::Job::WAIT_REASON_INPUTS:
      return "meshes unreadable";
    default:
      return absl::StrCat(job.queue_position(), " ahead");
  }
}

void ProgressDisplay::Show(const v1::Job& job, absl::Time now) {
  ProgressNews news;
  news.fraction = job.progress().total_fraction();
  news.label = Label(job);
  news.is_running = job.state() == v1::Job::STATE_RUNNING;
  line_.Show(news, now);
}

}  // namespace isomatch
