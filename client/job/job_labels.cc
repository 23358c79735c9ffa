#include "client/job/job_labels.h"

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"

namespace isomatch {

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

std::string VerdictLabel(const v1::Verdict& verdict) {
  switch (verdict.level()) {
    case v1::Verdict::LEVEL_GOOD:
      return "good";
    case v1::Verdict::LEVEL_DOUBTFUL:
      return "doubtful";
    case v1::Verdict::LEVEL_BAD:
      return "bad";
    default:
      return "unknown";
  }
}

std::string VerdictText(const v1::Verdict& verdict) {
  std::string text = VerdictLabel(verdict);
  if (!verdict.reason().empty()) {
    absl::StrAppend(&text, " (", verdict.reason(), ")");
  }
  if (!verdict.advice().empty()) {
    absl::StrAppend(&text, ": ", verdict.advice());
  }
  return text;
}

}  // namespace isomatch
