#include "tests/soak/random_requests.h"

#include "tests/server/test_server.h"
#include "tests/support/shapes.h"

namespace isomatch {

RandomRequests::RandomRequests(std::uint64_t seed, const KnownJobs* known)
    : random_(seed), known_(*known) {
  *slow_.mutable_mesh_x() = ToDraco(BumpySphere(/*levels=*/3));
  *slow_.mutable_mesh_y() = slow_.mesh_x();
}

RandomRequests::NewJob RandomRequests::Job(
    std::vector<std::string>& free_request_ids) {
  constexpr int kMillisecond = 1'000'000;  // nanoseconds
  NewJob job{slow_, std::nullopt};
  v1::CreateJobRequest& request = job.request;
  if (!OneIn(100)) {
    job.kind = Below(known_.count());
    request = known_.request(*job.kind);
  }
  if (!job.kind || OneIn(15)) {
    request.mutable_run_timeout()->set_nanos((1 + Below(300)) * kMillisecond);
  }
  if (OneIn(15)) {
    request.mutable_queue_timeout()->set_nanos((1 + Below(50)) * kMillisecond);
  }
  for (const char* label : {"a", "b"}) {
    if (OneIn(2)) {
      (*request.mutable_labels())[label] = OneIn(2) ? "1" : "2";
    }
  }
  request.set_priority(Below(5) - 2);
  request.set_validate_only(OneIn(20));
  if (OneIn(4)) return job;
  request.set_request_id(UniqueRequestId());
  if (!free_request_ids.empty() && OneIn(5)) {
    request.set_request_id(free_request_ids.back());
    free_request_ids.pop_back();
  }
  return job;
}

v1::ListJobsRequest RandomRequests::Filter() {
  v1::ListJobsRequest request;
  for (const char* label : {"a", "b"}) {
    if (OneIn(4)) (*request.mutable_labels())[label] = OneIn(2) ? "1" : "2";
  }
  for (int state = 1; state <= 5 && OneIn(2); ++state) {
    request.add_states(static_cast<v1::Job::State>(state));
  }
  if (OneIn(2)) request.set_page_size(static_cast<std::uint32_t>(Below(12)));
  return request;
}

const std::string& RandomRequests::Mesh() {
  const auto& request = known_.request(Below(known_.count()));
  return OneIn(2) ? request.mesh_x().draco() : request.mesh_y().draco();
}

}  // namespace isomatch
