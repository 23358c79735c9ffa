// What many watchers and many refused calls cost the server.

#include <array>
#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "tests/server/test_server.h"
#include "tests/soak/figures.h"
#include "tests/soak/known_jobs.h"
#include "tests/soak/soak_server.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

/// Reads one watch in gRPC's threads. It has to be done before it is destroyed.
class Watcher : public grpc::ClientReadReactor<v1::WatchJobResponse> {
 public:
  Watcher(Stub& stub, const std::string& name) {
    request_.set_name(name);
    stub.async()->WatchJob(&context_, &request_, this);
    StartRead(&response_);
    StartCall();
  }

  void OnReadDone(bool ok) override {
    if (!ok) return;
    ++messages_;
    last_ = response_.job().state();
    StartRead(&response_);
  }

  void OnDone(const grpc::Status& status) override {
    ended_well_ = status.ok();
    is_done_ = true;
  }

  bool has_begun() const { return messages_ > 0; }
  bool is_done() const { return is_done_; }
  bool ended_well() const { return ended_well_; }
  v1::Job::State last() const { return last_; }

 private:
  CallContext context_;
  v1::WatchJobRequest request_;
  v1::WatchJobResponse response_;
  std::atomic<int> messages_ = 0;
  std::atomic<v1::Job::State> last_ = v1::Job::STATE_UNSPECIFIED;
  std::atomic<bool> ended_well_ = false;
  std::atomic<bool> is_done_ = false;
};

using Watchers = std::vector<std::unique_ptr<Watcher>>;

void WaitForAll(const Watchers& watchers,
                const std::function<bool(const Watcher&)>& holds) {
  const absl::Time end = absl::Now() + absl::Minutes(1);
  for (const auto& watcher : watchers) {
    while (!holds(*watcher) && absl::Now() < end) {
      absl::SleepFor(absl::Milliseconds(1));
    }
    ASSERT_TRUE(holds(*watcher));
  }
}

/// As many watchers of one job, over four connections.
class ManyWatchers {
 public:
  ManyWatchers(const SoakServer& server, const std::string& name, int count) {
    for (auto& stub : stubs_) {
      stub = v1::CorrespondenceService::NewStub(server.Connect());
    }
    for (int i = 0; i < count; ++i) {
      Stub& stub = *stubs_[static_cast<size_t>(i) % stubs_.size()];
      all_.push_back(std::make_unique<Watcher>(stub, name));
    }
    WaitForAll(all_, &Watcher::has_begun);
  }
  const Watchers& all() const { return all_; }

 private:
  std::array<std::unique_ptr<Stub>, 4> stubs_;
  Watchers all_;
};

TEST(MemoryTest, ManyWatchersCostLittle) {
  SoakServer server;
  // Its memory changes little once it is in the long third stage.
  const auto runs = CreateJob(server.stub(), LongJob());
  ASSERT_TRUE(runs.ok()) << runs.status();
  WaitUntilRuns(server.stub(), runs->name());
  const auto waits = CreateJob(server.stub(), LongJob());
  ASSERT_TRUE(waits.ok()) << waits.status();
  const std::int64_t before = server.SettledResidentBytes();
  const int count = Rounds("ISOMATCH_WATCHERS", 1000, 1000);
  const ManyWatchers watchers(server, waits->name(), count);
  const std::int64_t after = server.ResidentBytes();
  const absl::Time begin = absl::Now();
  ASSERT_TRUE(CancelJob(server.stub(), waits->name()).ok());
  WaitForAll(watchers.all(), &Watcher::is_done);
  PrintFigure("watchers: all have the end after",
              absl::ToDoubleMilliseconds(absl::Now() - begin), "ms");
  for (const auto& watcher : watchers.all()) {
    EXPECT_TRUE(watcher->ended_well());
    EXPECT_EQ(watcher->last(), v1::Job::STATE_CANCELLED);
  }
  ExpectAtMost(absl::StrCat("watchers: memory of ", count),
               static_cast<double>(after - before) / kMebibyte, 64, "MiB");
}

/// Calls that a server refuses, in every way but those that need its disk full.
class RefusedCalls {
 public:
  explicit RefusedCalls(SoakServer& server) : stub_(server.stub()) {
    *good_.mutable_mesh_x() = ToDraco(Tetrahedron());
    *good_.mutable_mesh_y() = good_.mesh_x();
    malformed_ = good_;
    malformed_.mutable_mesh_x()->set_draco("no Draco");
    missing_ = good_;
    missing_.mutable_mesh_x()->mutable_digest()->set_sha256(
        std::string(64, 'a'));
    missing_.mutable_mesh_x()->mutable_digest()->set_size_bytes(100);
    labels_ = good_;
    for (int i = 0; i < 17; ++i) {
      (*labels_.mutable_labels())[absl::StrCat("label", i)] =
          std::string(200, 'x');
    }
  }

  absl::Status Call(int i) {
    const std::string name = absl::StrCat(
        "jobs/", absl::Hex(i, absl::kZeroPad16), "0123456789abcdef");
    switch (i % 10) {
      case 0:
        return GetJob(stub_, name).status();
      case 1:
        return CreateJob(stub_, malformed_).status();
      case 2:
        return CreateJob(stub_, missing_).status();
      case 3:
        return CreateJob(stub_, labels_).status();
      case 4:
        return CancelJob(stub_, name).status();
      case 5:
        return DeleteJob(stub_, name);
      case 6:
        return WaitForEnd(stub_, name).status();
      case 7:
        return Download(stub_, name, v1::RESULT_PART_MAP).status();
      case 8:
        return ListJobs(name);
      default:
        return UploadMesh(i);
    }
  }

 private:
  absl::Status ListJobs(const std::string& token) {
    CallContext context;
    v1::ListJobsRequest request;
    request.set_page_token(token);
    v1::ListJobsResponse response;
    return ToStatus(stub_.ListJobs(&context, request, &response));
  }

  /// Content of another digest than the header says, a new one each time.
  absl::Status UploadMesh(int i) {
    CallContext context;
    v1::UploadMeshResponse response;
    const auto writer = stub_.UploadMesh(&context, &response);
    v1::UploadMeshRequest header;
    header.mutable_header()->set_sha256(
        absl::StrCat(std::string(48, 'b'), absl::Hex(i, absl::kZeroPad16)));
    header.mutable_header()->set_size_bytes(1000);
    writer->Write(header);
    v1::UploadMeshRequest chunk;
    chunk.set_chunk(std::string(1000, 'c'));
    writer->Write(chunk);
    writer->WritesDone();
    return ToStatus(writer->Finish());
  }

  static absl::Status ToStatus(const grpc::Status& status) {
    return {static_cast<absl::StatusCode>(status.error_code()),
            status.error_message()};
  }

  Stub& stub_;
  v1::CreateJobRequest good_;
  v1::CreateJobRequest malformed_;
  v1::CreateJobRequest missing_;
  v1::CreateJobRequest labels_;
};

TEST(MemoryTest, RefusedCallsLeaveNothingBehind) {
  SoakServer server;
  RefusedCalls refused(server);
  const int count = Rounds("ISOMATCH_REFUSED", 6000, 100'000);
  const int warm_up = count / 5;
  for (int i = 0; i < warm_up; ++i) {
    ASSERT_FALSE(refused.Call(i).ok()) << i;
  }
  const std::int64_t before = server.SettledResidentBytes();
  for (int i = 0; i < count; ++i) {
    const absl::Status status = refused.Call(warm_up + i);
    ASSERT_FALSE(status.ok()) << i;
    ASSERT_FALSE(absl::IsDeadlineExceeded(status) ||
                 absl::IsUnavailable(status))
        << i << ": " << status;
  }
  const std::int64_t after = server.SettledResidentBytes();
  EXPECT_EQ(GetInfo(server.stub()).memory_reserved_bytes(), 0);
  PrintFigure("refused calls", count, "");
  ExpectAtMost("refused calls: memory they left",
               static_cast<double>(after - before) / kMebibyte, 5, "MiB");
}

}  // namespace
}  // namespace isomatch
