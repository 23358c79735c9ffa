#include "client/cli/job_text.h"

#include <algorithm>
#include <array>

#include <google/protobuf/util/json_util.h>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "client/job/job_labels.h"

namespace isomatch {
namespace {

constexpr std::array kStates = {v1::Job::STATE_QUEUED, v1::Job::STATE_RUNNING,
                                v1::Job::STATE_SUCCEEDED, v1::Job::STATE_FAILED,
                                v1::Job::STATE_CANCELLED};

constexpr double kMegabyte = 1e6;

void AppendLine(std::string& text, absl::string_view label,
                absl::string_view value) {
  absl::StrAppendFormat(&text, "%-16s %s\n", label, value);
}

absl::Time ToTime(const google::protobuf::Timestamp& time) {
  return absl::FromUnixSeconds(time.seconds()) +
         absl::Nanoseconds(time.nanos());
}

std::string FormatTime(const google::protobuf::Timestamp& time) {
  return absl::FormatTime("%Y-%m-%d %H:%M:%S", ToTime(time),
                          absl::LocalTimeZone());
}

std::string FormatLabels(const v1::Job& job) {
  std::vector<std::string> labels;
  for (const auto& [key, value] : job.labels()) {
    labels.push_back(absl::StrCat(key, "=", value));
  }
  std::sort(labels.begin(), labels.end());
  return absl::StrJoin(labels, " ");
}

void AppendResult(std::string& text, const v1::ResultInfo& result) {
  AppendLine(text, "vertices",
             absl::StrCat(result.mesh_x().vertices(), " to ",
                          result.mesh_y().vertices()));
  AppendLine(text, "run",
             absl::StrFormat("%.2f s, %.0f MB", result.run_seconds(),
                             static_cast<double>(result.peak_resident_bytes()) /
                                 kMegabyte));
  AppendLine(
      text, "quality",
      absl::StrFormat(
          "geodesic distortion %.4f, coverage %.2f, confidence %.2f, "
          "symmetry confidence %.2f",
          result.quality().geodesic_distortion(), result.quality().coverage(),
          result.quality().mean_confidence(), result.symmetry_confidence()));
  AppendLine(text, "verdict", VerdictText(result.verdict()));
  for (const std::string& warning : result.warnings()) {
    AppendLine(text, "warning", warning);
  }
}

// What the STATE column's neighbor says.
std::string Detail(const v1::Job& job) {
  switch (job.state()) {
    case v1::Job::STATE_QUEUED:
      return WaitLabel(job);
    case v1::Job::STATE_RUNNING:
      return absl::StrFormat("%.0f %% %s",
                             100 * job.progress().total_fraction(),
                             StageLabel(job.progress().stage()));
    case v1::Job::STATE_SUCCEEDED:
      return absl::StrFormat("%.1f s, %s", job.result().run_seconds(),
                             VerdictLabel(job.result().verdict()));
    case v1::Job::STATE_FAILED:
      return job.error().reason();
    default:
      return "";
  }
}

}  // namespace

std::string ToJsonLine(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.always_print_primitive_fields = true;
  options.preserve_proto_field_names = true;
  std::string json;
  // Fails for Any and times out of range only, which no message of ours has.
  static_cast<void>(
      google::protobuf::util::MessageToJsonString(message, &json, options));
  return json + "\n";
}

absl::StatusOr<v1::Job::State> ParseState(const std::string& text) {
  std::vector<std::string> allowed;
  for (const v1::Job::State state : kStates) {
    if (absl::AsciiStrToLower(text) == StateLabel(state)) return state;
    allowed.push_back(StateLabel(state));
  }
  return absl::InvalidArgumentError(absl::StrCat("--state is '", text,
                                                 "', expected one of ",
                                                 absl::StrJoin(allowed, ", ")));
}

std::string FullJobName(const std::string& word) {
  return absl::StartsWith(word, "jobs/") ? word : absl::StrCat("jobs/", word);
}

std::string FormatJob(const v1::Job& job) {
  std::string text;
  AppendLine(text, "job", job.name());
  AppendLine(text, "state",
             absl::StrCat(StateLabel(job.state()), "  ", Detail(job)));
  if (job.state() == v1::Job::STATE_FAILED) {
    AppendLine(text, "error", job.error().message());
  }
  AppendLine(text, "created", FormatTime(job.create_time()));
  if (job.has_start_time()) {
    AppendLine(text, "started", FormatTime(job.start_time()));
  }
  if (job.has_end_time()) AppendLine(text, "ended", FormatTime(job.end_time()));
  AppendLine(text, "priority", absl::StrCat(job.priority()));
  AppendLine(text, "attempt", absl::StrCat(job.attempt()));
  if (!job.labels().empty()) AppendLine(text, "labels", FormatLabels(job));
  AppendLine(text, "memory reserved",
             absl::StrFormat(
                 "%.0f MB",
                 static_cast<double>(job.memory_estimate_bytes()) / kMegabyte));
  if (job.has_result()) AppendResult(text, job.result());
  return text;
}

std::string FormatJobs(const std::vector<v1::Job>& jobs, absl::Time now) {
  std::string text = absl::StrFormat("%-42s %-10s %-26s %-8s %s\n", "JOB",
                                     "STATE", "", "AGE", "LABELS");
  for (const v1::Job& job : jobs) {
    std::string line =
        absl::StrFormat("%-42s %-10s %-26s %-8s %s", job.name(),
                        StateLabel(job.state()), Detail(job),
                        FormatLeft(std::max(now - ToTime(job.create_time()),
                                            absl::ZeroDuration())),
                        FormatLabels(job));
    absl::StripTrailingAsciiWhitespace(&line);
    absl::StrAppend(&text, line, "\n");
  }
  return text;
}

std::string FormatServerInfo(const v1::GetServerInfoResponse& info) {
  const v1::GetServerInfoResponse::Limits& limits = info.limits();
  std::string text;
  AppendLine(text, "version", info.version());
  AppendLine(text, "state",
             info.draining() ? "draining, takes no new jobs" : "ready");
  AppendLine(text, "jobs",
             absl::StrCat(info.running_jobs(), " running, ", info.queued_jobs(),
                          " queued of at most ", limits.max_queued_jobs()));
  AppendLine(text, "workers",
             info.workers() == 0
                 ? "none is running: jobs wait"
                 : absl::StrCat(info.workers(), ", ", info.threads_per_job(),
                                " threads a job"));
  if (info.memory_budget_bytes() > 0) {
    AppendLine(
        text, "memory",
        absl::StrFormat(
            "%.0f of %.0f MB reserved",
            static_cast<double>(info.memory_reserved_bytes()) / kMegabyte,
            static_cast<double>(info.memory_budget_bytes()) / kMegabyte));
  }
  AppendLine(text, "a mesh",
             absl::StrFormat(
                 "at most %d vertices, %d faces, %.0f MB",
                 limits.max_vertices(), limits.max_faces(),
                 static_cast<double>(limits.max_mesh_bytes()) / kMegabyte));
  AppendLine(text, "jobs are kept",
             info.durable() ? "on disk, also when the server ends"
                            : "in memory, until the server ends");
  if (info.has_job_retention()) {
    AppendLine(
        text, "for",
        absl::FormatDuration(absl::Seconds(info.job_retention().seconds())));
  }
  if (!info.tenant().empty()) AppendLine(text, "tenant", info.tenant());
  return text;
}

}  // namespace isomatch
