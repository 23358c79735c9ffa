#include "client/cli/progress_display.h"

#include "absl/strings/str_cat.h"
#include "client/job/job_labels.h"

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

void ProgressDisplay::Show(const v1::Job& job, absl::Time now) {
  ProgressNews news;
  news.fraction = job.progress().total_fraction();
  news.label = Label(job);
  news.is_running = job.state() == v1::Job::STATE_RUNNING;
  line_.Show(news, now);
}

}  // namespace isomatch
