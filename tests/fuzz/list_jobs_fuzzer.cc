// ListJobs against a store of a few jobs. Any request ends in INVALID_FIELD or
// in a page of jobs that match; following the tokens gives each of them once,
// newest first; a token of one filter is none of another. The input is two
// ListJobsRequests, the length of the first in front.

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "server/convert/list_jobs.h"
#include "server/jobs/errors.h"
#include "server/storage/memory_job_store.h"
#include "tests/fuzz/byte_reader.h"
#include "tests/fuzz/check.h"

namespace isomatch {
namespace {

constexpr int kJobs = 12;

class FuzzedStore {
 public:
  FuzzedStore() {
    for (int i = 0; i < kJobs; ++i) {
      JobRecord record;
      record.id = absl::StrCat(i);
      record.labels["parity"] = i % 2 == 0 ? "even" : "odd";
      if (i % 3 == 0) record.labels["third"] = "";
      record = *store_.Insert(record);
      record.state = static_cast<JobState>(1 + i % 5);
      ISOMATCH_CHECK(store_.Update(record).ok());
    }
  }

  const MemoryJobStore& store() const { return store_; }

 private:
  MemoryJobStore store_;
};

bool Matches(const JobRecord& record, const v1::ListJobsRequest& request) {
  bool has_state = request.states().empty();
  for (const int state : request.states()) {
    has_state |= state == static_cast<int>(record.state);
  }
  for (const auto& [key, value] : request.labels()) {
    const auto found = record.labels.find(key);
    if (found == record.labels.end() || found->second != value) return false;
  }
  return has_state;
}

/// Follows the tokens from the first page on.
std::vector<std::uint64_t> AllPages(const MemoryJobStore& store,
                                    v1::ListJobsRequest request) {
  std::vector<std::uint64_t> numbers;
  request.clear_page_token();
  for (int page = 0; page <= kJobs; ++page) {
    const auto filter = ParseListJobs(request);
    ISOMATCH_CHECK(filter.ok());
    const auto jobs = store.List(*filter);
    ISOMATCH_CHECK(jobs.ok());
    if (jobs->empty()) return numbers;
    for (const JobRecord& job : *jobs) {
      ISOMATCH_CHECK(numbers.empty() || job.number < numbers.back());
      ISOMATCH_CHECK(Matches(job, request));
      numbers.push_back(job.number);
    }
    request.set_page_token(MakePageToken(*filter, numbers.back()));
  }
  return numbers;
}

void CheckPages(const MemoryJobStore& store,
                const v1::ListJobsRequest& request) {
  const auto filter = ParseListJobs(request);
  if (!filter.ok()) {
    ISOMATCH_CHECK(DetailsOf(filter.status()).reason == "INVALID_FIELD");
    ISOMATCH_CHECK(!DetailsOf(filter.status()).field.empty());
    return;
  }
  std::size_t matching = 0;
  const auto all = store.List({.limit = 1000});
  ISOMATCH_CHECK(all.ok());
  for (const JobRecord& record : *all) {
    matching += Matches(record, request) ? 1 : 0;
  }
  ISOMATCH_CHECK(AllPages(store, request).size() == matching);
}

/// A token of `from` is accepted by `to` exactly when they filter alike.
void CheckToken(v1::ListJobsRequest from, v1::ListJobsRequest to) {
  from.clear_page_token();
  to.clear_page_token();
  const auto filter = ParseListJobs(from);
  const auto other = ParseListJobs(to);
  if (!filter.ok() || !other.ok()) return;
  to.set_page_token(MakePageToken(*filter, 7));
  const bool alike = MakePageToken(*filter, 7) == MakePageToken(*other, 7);
  ISOMATCH_CHECK(ParseListJobs(to).ok() == alike);
  ISOMATCH_CHECK(!alike || filter->labels == other->labels);
}

}  // namespace
}  // namespace isomatch

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data,
                                      std::size_t size) {
  static const isomatch::FuzzedStore jobs;
  isomatch::ByteReader reader(data, size);
  isomatch::v1::ListJobsRequest first;
  isomatch::v1::ListJobsRequest second;
  const std::size_t length = reader.Byte();
  if (!first.ParseFromString(reader.Text(length)) ||
      !second.ParseFromString(reader.Text(size))) {
    return 0;
  }
  isomatch::CheckPages(jobs.store(), first);
  isomatch::CheckToken(first, second);
  return 0;
}
