#include "server/storage/process_trace.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

#include <nlohmann/json.hpp>

#include "server/storage/files.h"

namespace isomatch {
namespace {

constexpr std::int64_t kMaxTraceBytes = std::int64_t{1} << 20;

nlohmann::json TraceToJson(const ProcessTrace& trace) {
  nlohmann::json jobs = nlohmann::json::array();
  for (const JobTrace& job : trace.jobs) {
    jobs.push_back({{"id", job.id},
                    {"attempt", job.attempt},
                    {"silent_seconds", absl::ToDoubleSeconds(job.silent)},
                    {"stuck", job.is_stuck},
                    {"resident_bytes_at_begin", job.resident_at_begin}});
    if (!job.unanswered) continue;
    jobs.back()["unanswered_seconds"] = absl::ToDoubleSeconds(*job.unanswered);
  }
  return {{"resident_bytes", trace.resident_bytes},
          {"expected_bytes", trace.expected_bytes},
          {"jobs", std::move(jobs)}};
}

/// Throws nlohmann::json::exception.
ProcessTrace TraceFromJson(const nlohmann::json& json) {
  ProcessTrace trace;
  trace.resident_bytes = json.at("resident_bytes").get<std::int64_t>();
  trace.expected_bytes = json.at("expected_bytes").get<std::int64_t>();
  for (const nlohmann::json& job : json.at("jobs")) {
    trace.jobs.push_back(
        {job.at("id").get<std::string>(), job.at("attempt").get<std::int32_t>(),
         absl::Seconds(job.at("silent_seconds").get<double>())});
    trace.jobs.back().is_stuck = job.value("stuck", false);
    trace.jobs.back().resident_at_begin =
        job.value("resident_bytes_at_begin", std::int64_t{0});
    const auto unanswered = job.find("unanswered_seconds");
    if (unanswered == job.end()) continue;
    trace.jobs.back().unanswered = absl::Seconds(unanswered->get<double>());
  }
  return trace;
}

}  // namespace

TraceFile::TraceFile(std::string path)
    : path_(std::move(path)),
      file_(FileDescriptor::Open(path_, O_RDWR | O_CREAT)) {}

ProcessTrace TraceFile::Read() {
  const auto bytes = ReadWholeFile(path_, kMaxTraceBytes);
  if (!bytes.ok()) return {};
  size_ = bytes->size();
  try {
    return TraceFromJson(nlohmann::json::parse(*bytes));
  } catch (const nlohmann::json::exception&) {  // empty, or half written
    return {};
  }
}

void TraceFile::Write(const ProcessTrace& trace) {
  if (!file_.is_open()) return;
  std::string text = TraceToJson(trace).dump();
  // Blanks cover what was there: cutting the file would leave a moment in which
  // it is empty.
  size_ = std::max(size_, text.size());
  text.resize(size_, ' ');
  (void)!pwrite(file_.get(), text.data(), text.size(), 0);
}

}  // namespace isomatch
