// Many jobs in the real isomatch-server, which is killed among them.

#include <algorithm>
#include <csignal>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "isomatch/v1/service.grpc.pb.h"
#include "tests/server/child_process.h"
#include "tests/server/test_server.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

constexpr int kJobs = 50;

/// Every tenth.
bool IsLarge(int job) { return job % 10 == 4; }

v1::CreateJobRequest RequestOf(int job) {
  const TriangleMesh mesh = BumpySphere(IsLarge(job) ? 3 : 2);
  v1::CreateJobRequest request;
  *request.mutable_mesh_x() = ToDraco(mesh);
  *request.mutable_mesh_y() = ToDraco(mesh);
  request.mutable_options()->set_random_seed(job);
  return request;
}

/// A server process and calls to it, all of which have to succeed.
class Running {
 public:
  explicit Running(const std::vector<std::string>& flags)
      : server_(ISOMATCH_SERVER_BINARY, flags),
        stub_(v1::CorrespondenceService::NewStub(grpc::CreateChannel(
            server_.address, grpc::InsecureChannelCredentials()))) {}

  v1::Job Create(const v1::CreateJobRequest& request) {
    grpc::ClientContext context;
    v1::CreateJobResponse response;
    EXPECT_TRUE(stub_->CreateJob(&context, request, &response).ok());
    return response.job();
  }

  v1::Job Get(const std::string& name) {
    grpc::ClientContext context;
    v1::GetJobRequest request;
    request.set_name(name);
    v1::GetJobResponse response;
    EXPECT_TRUE(stub_->GetJob(&context, request, &response).ok());
    return response.job();
  }

  /// Waits until at most so many jobs wait or run; meanwhile what is reserved
  /// has to fit the budget. Returns the most that was.
  std::uint64_t WaitUntilLeft(std::uint32_t count) {
    std::uint64_t most = 0;
    while (true) {
      grpc::ClientContext context;
      v1::GetServerInfoResponse info;
      EXPECT_TRUE(stub_->GetServerInfo(&context, {}, &info).ok());
      EXPECT_LE(info.memory_reserved_bytes(), info.memory_budget_bytes());
      most = std::max(most, info.memory_reserved_bytes());
      if (info.queued_jobs() + info.running_jobs() <= count) return most;
      absl::SleepFor(absl::Milliseconds(2));
    }
  }

  void Kill() {
    server_.process.Signal(SIGKILL);
    EXPECT_EQ(server_.process.ExitStatus(), -1);
  }

 private:
  ServerProcess server_;
  std::unique_ptr<v1::CorrespondenceService::Stub> stub_;
};

/// What a job of this request may need, says a server that runs nothing.
std::uint64_t EstimateOf(v1::CreateJobRequest request) {
  request.set_validate_only(true);
  return Running({"--prepared-cache-bytes", "0"})
      .Create(request)
      .memory_estimate_bytes();
}

TEST(QueueingProcessTest, FiftyJobsEndAlthoughTheServerIsKilledAmongThem) {
  const TemporaryFolder folder;
  const std::uint64_t small = EstimateOf(RequestOf(0));
  const std::uint64_t large = EstimateOf(RequestOf(4));
  // Room for three small ones, or for a large one with few beside it.
  const std::uint64_t budget = std::max(3 * small, large) + small / 2;
  const std::vector<std::string> flags = {"--data-dir",
                                          folder.Path("data"),
                                          "--workers",
                                          "2",
                                          "--memory-budget",
                                          absl::StrCat(budget),
                                          "--prepared-cache-bytes",
                                          "0",
                                          "--max-queued-jobs",
                                          absl::StrCat(kJobs)};
  std::vector<std::string> names;
  std::vector<bool> had_ended;
  {
    Running server(flags);
    for (int job = 0; job < kJobs; ++job) {
      names.push_back(server.Create(RequestOf(job)).name());
    }
    EXPECT_GT(server.WaitUntilLeft(kJobs / 2), 0);
    for (const std::string& name : names) {
      had_ended.push_back(server.Get(name).state() == v1::Job::STATE_SUCCEEDED);
    }
    server.Kill();
  }
  Running server(flags);
  server.WaitUntilLeft(0);
  int again = 0;
  absl::Time last_start = absl::InfinitePast();
  for (int job = 0; job < kJobs; ++job) {
    const v1::Job ended = server.Get(names[job]);
    EXPECT_EQ(ended.state(), v1::Job::STATE_SUCCEEDED) << ended.DebugString();
    EXPECT_LE(ended.attempt(), had_ended[job] ? 1 : 2);
    if (ended.attempt() == 2) {
      ++again;
      continue;
    }
    // Those of one size in the order of their creation; both workers may take
    // one at the same time.
    if (IsLarge(job)) continue;
    const absl::Time start = ToTime(ended.start_time());
    EXPECT_GT(start, last_start - absl::Milliseconds(500)) << job;
    last_start = std::max(last_start, start);
  }
  EXPECT_LE(again, 2);  // only those that ran
}

}  // namespace
}  // namespace isomatch
