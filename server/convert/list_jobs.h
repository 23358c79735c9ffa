#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "isomatch/v1/service.pb.h"
#include "server/jobs/job_manager.h"
#include "server/storage/job_store.h"

namespace isomatch {

/// Returns which jobs the request asks for, `limit` of them.
/// INVALID_ARGUMENT (INVALID_FIELD): page_size, a state or a label out of
/// range, a page_token that MakePageToken did not make for this filter.
absl::StatusOr<JobFilter> ParseListJobs(const v1::ListJobsRequest& request);

/// Returns what asks for the jobs before the one of this number. It holds a
/// checksum of states and labels, because on with others it would skip jobs or
/// give some twice; the page's size may change. No secret: it grants nothing.
std::string MakePageToken(const JobFilter& filter, std::uint64_t number);

/// What a page has at most: a client takes 4 MiB if nobody says otherwise.
inline constexpr size_t kPageBytes = size_t{3} << 20;

/// Answers with the first `page_size` of the jobs, fewer if they would have
/// more than kPageBytes, and with the token of the next page if some are left.
void FillPage(const std::vector<JobSnapshot>& jobs, const JobFilter& filter,
              int page_size, v1::ListJobsResponse& response);

}  // namespace isomatch
