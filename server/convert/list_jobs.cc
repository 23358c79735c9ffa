#include "server/convert/list_jobs.h"

#include <cstdint>
#include <limits>
#include <set>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "server/convert/job_proto.h"
#include "server/convert/labels.h"
#include "server/convert/request_limits.h"
#include "server/jobs/errors.h"

namespace isomatch {
namespace {

// Hexadecimal digits of a token: the number, then the checksum.
constexpr size_t kNumberDigits = 16;
constexpr size_t kChecksumDigits = 16;

/// Every part with its length, so that no two filters read alike.
std::string Canonical(const JobFilter& filter) {
  std::string text;
  for (const JobState state :
       std::set<JobState>(filter.states.begin(), filter.states.end())) {
    absl::StrAppend(&text, static_cast<int>(state), ",");
  }
  for (const auto& [key, value] : filter.labels) {
    absl::StrAppend(&text, key.size(), ":", key, value.size(), ":", value);
  }
  return text;
}

absl::StatusOr<std::uint64_t> ParsePageToken(const std::string& token,
                                             const JobFilter& filter) {
  // A database has no larger ones.
  constexpr std::uint64_t kMostNumber =
      std::numeric_limits<std::int64_t>::max();
  std::uint64_t number = 0;
  const bool has_number =
      token.size() == kNumberDigits + kChecksumDigits &&
      absl::SimpleHexAtoi(token.substr(0, kNumberDigits), &number);
  const bool is_number = has_number && number > 0 && number <= kMostNumber;
  if (is_number && token == MakePageToken(filter, number)) return number;
  return InvalidField("page_token",
                      "expected one that ListJobs gave for the same filter");
}

}  // namespace

std::string MakePageToken(const JobFilter& filter, std::uint64_t number) {
  const std::string digits = absl::StrCat(absl::Hex(number, absl::kZeroPad16));
  return absl::StrCat(digits, Sha256Hex(absl::StrCat(digits, Canonical(filter)))
                                  .substr(0, kChecksumDigits));
}

void FillPage(const std::vector<JobSnapshot>& jobs, const JobFilter& filter,
              int page_size, v1::ListJobsResponse& response) {
  constexpr size_t kFieldBytes = 8;  // of each job, beside its own
  size_t bytes = 0;
  std::uint64_t last_number = 0;
  for (const JobSnapshot& snapshot : jobs) {
    v1::Job job = ToProto(snapshot);
    // Thousands of them for each job would not fit one answer.
    if (job.has_result()) job.mutable_result()->clear_landmarks();
    bytes += job.ByteSizeLong() + kFieldBytes;
    const bool is_full = response.jobs_size() == page_size ||
                         (response.jobs_size() > 0 && bytes > kPageBytes);
    if (is_full) {
      response.set_next_page_token(MakePageToken(filter, last_number));
      return;
    }
    last_number = snapshot.record.number;
    *response.add_jobs() = std::move(job);
  }
}

absl::StatusOr<JobFilter> ParseListJobs(const v1::ListJobsRequest& request) {
  JobFilter filter;
  if (request.page_size() > RequestLimits::kMaxPageSize) {
    return InvalidField("page_size",
                        absl::StrCat(request.page_size(), ", expected 0 to ",
                                     RequestLimits::kMaxPageSize));
  }
  filter.limit = request.page_size() == 0
                     ? RequestLimits::kDefaultPageSize
                     : static_cast<int>(request.page_size());
  for (int i = 0; i < request.states_size(); ++i) {
    ISOMATCH_ASSIGN_OR_RETURN(
        const JobState state,
        ParseJobState(request.states(i), absl::StrCat("states[", i, "]")));
    filter.states.push_back(state);
  }
  ISOMATCH_ASSIGN_OR_RETURN(filter.labels,
                            ParseLabels(request.labels(), "labels"));
  if (!request.page_token().empty()) {
    ISOMATCH_ASSIGN_OR_RETURN(filter.before_number,
                              ParsePageToken(request.page_token(), filter));
  }
  return filter;
}

}  // namespace isomatch
