// Two tenants: Alice does all harm that her key allows, at once; Bob works.

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <grpcpp/generic/generic_stub.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/mutex.h"
#include "core/base/sha256.h"
#include "tests/server/test_server.h"
#include "tests/soak/figures.h"
#include "tests/soak/soak_server.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

constexpr char kAlice[] = "alice";
constexpr char kBob[] = "bob";
constexpr std::int64_t kBudget = std::int64_t{1} << 30;

/// Of meshes that are small, unless they are to take a while.
v1::CreateJobRequest JobOf(int seed, int level = 1) {
  v1::CreateJobRequest request;
  *request.mutable_mesh_x() = ToDraco(BumpySphere(level));
  *request.mutable_mesh_y() = request.mesh_x();
  request.mutable_options()->set_random_seed(seed);
  return request;
}

/// A wavy square of side x side vertices.
TriangleMesh WavyGrid(VertexIndex side) {
  TriangleMesh mesh;
  mesh.positions.resize(side * side, 3);
  mesh.faces.resize(2 * (side - 1) * (side - 1), 3);
  for (VertexIndex row = 0; row < side; ++row) {
    for (VertexIndex column = 0; column < side; ++column) {
      mesh.positions.row(row * side + column) << row, column,
          3 * std::sin(0.1 * row) * std::cos(0.07 * column);
    }
  }
  Eigen::Index face = 0;
  for (VertexIndex row = 0; row + 1 < side; ++row) {
    for (VertexIndex column = 0; column + 1 < side; ++column) {
      const VertexIndex v = row * side + column;
      mesh.faces.row(face++) << v, v + 1, v + side;
      mesh.faces.row(face++) << v + 1, v + side + 1, v + side;
    }
  }
  return mesh;
}

/// What attacks are answered when they take hold.
constexpr std::pair<const char*, const char*> kAnswers[] = {
    {"create and cancel", "OK"},
    {"delete", "OK"},
    {"fill the queue", "OK"},
    {"fill the queue", "TENANT_QUOTA"},
    {"read", "OK"},
    {"hold an upload", "OK"},
    {"open a known upload", "OK"},
    {"open a known upload", "UPLOAD_QUOTA"},
    {"fill the store", "OK"},
    {"CreateJob", "INVALID_FIELD"},
    {"WatchJob", "INVALID_FIELD"},
    {"UploadMesh", "INVALID_FIELD"},
    {"GetServerInfo", "API_KEY_MISSING"}};

class HostileTenantTest : public testing::Test {
 protected:
  HostileTenantTest() {
    server_ = std::make_unique<SoakServer>(std::vector<std::string>{
        "--api-keys", folder_.Write("keys", KeysOf({kAlice, kBob})),
        "--memory-budget", absl::StrCat(kBudget),
        // So that Alice can fill her shares of them.
        "--workers", "4", "--max-queued-jobs", "8"});
  }

  ~HostileTenantTest() override { StopAll(); }

  /// Runs `attack` again and again, with a connection of its own.
  void Attack(const std::function<void(Stub&)>& attack) {
    attackers_.emplace_back([this, attack] {
      const auto stub = v1::CorrespondenceService::NewStub(server_->Connect());
      while (!stop_) {
        attack(*stub);
      }
    });
  }

  void WatchMemory() {
    attackers_.emplace_back([this] {
      while (!stop_) {
        most_bytes_ = std::max(most_bytes_, server_->ResidentBytes());
        absl::SleepFor(absl::Milliseconds(50));
      }
    });
  }

  void StopAll() {
    stop_ = true;
    for (std::thread& attacker : attackers_) attacker.join();
    attackers_.clear();
  }

  /// Counts an answer to an attack: "OK", or the reason why not.
  void Note(const std::string& attack, const std::string& answer) {
    MutexLock lock(mutex_);
    ++answers_[attack][answer];
    ++attacks_;
  }
  void Note(const std::string& attack, const absl::Status& status) {
    Note(attack, status.ok() ? "OK" : ReasonOf(status));
  }

  /// Returns the answers that are missing of those that attacks get when they
  /// take hold; empty when there are none.
  std::string MissingAnswers() {
    MutexLock lock(mutex_);
    std::string missing;
    for (const auto& [attack, answer] : kAnswers) {
      if (answers_[attack][answer] > 0) continue;
      absl::StrAppend(&missing, attack, " never got ", answer, ", but");
      for (const auto& [other, count] : answers_[attack]) {
        absl::StrAppend(&missing, " ", other, ": ", count);
      }
      absl::StrAppend(&missing, "\n");
    }
    return missing;
  }

  void SendBytes(const std::string& method, const std::string& bytes,
                 const std::string& key);
  void DoAllHarm();
  void ExpectThatAttacksTookHold();
  int CountStarted(const std::string& key);

  void CreateAndCancel();
  void FillTheQueue();
  void ReadLargeMeshes();
  void HoldUploadRoom();
  void OpenKnownUploads();
  void SendManyFields();
  void FillTheStore();

  const TemporaryFolder folder_;
  std::unique_ptr<SoakServer> server_;
  std::atomic<bool> stop_ = false;
  Mutex mutex_;
  std::map<std::string, std::map<std::string, int>> answers_
      ABSL_GUARDED_BY(mutex_);
  int attacks_ ABSL_GUARDED_BY(mutex_) = 0;
  std::int64_t most_bytes_ = 0;
  /// Bytes of a large mesh that the server has.
  std::string large_mesh_;
  std::vector<std::thread> attackers_;
};

void HostileTenantTest::CreateAndCancel() {
  Attack([this](Stub& stub) {
    const auto job = CreateJob(stub, JobOf(1), kAlice);
    Note("create and cancel", job.status());
    if (!job.ok()) return;
    (void)CancelJob(stub, job->name(), kAlice);
    Note("delete", DeleteJob(stub, job->name(), kAlice));
  });
}

void HostileTenantTest::FillTheQueue() {
  for (int i = 0; i < 8; ++i) {
    Attack([this, seed = 100 * i](Stub& stub) mutable {
      v1::CreateJobRequest request = JobOf(++seed, /*level=*/4);
      request.set_priority(100);
      const auto job = CreateJob(stub, request, kAlice);
      Note("fill the queue", job.status());
      if (!job.ok()) absl::SleepFor(absl::Milliseconds(10));
    });
  }
}

void HostileTenantTest::ReadLargeMeshes() {
  const v1::Mesh mesh = ToDraco(WavyGrid(IsSoak() ? 350 : 200));
  large_mesh_ = mesh.draco();
  ASSERT_TRUE(UploadMesh(server_->stub(), large_mesh_, kAlice).ok());
  v1::CreateJobRequest request;
  request.set_validate_only(true);
  for (v1::Mesh* const side :
       {request.mutable_mesh_x(), request.mutable_mesh_y()}) {
    side->mutable_digest()->set_sha256(Sha256Hex(mesh.draco()));
    side->mutable_digest()->set_size_bytes(mesh.draco().size());
  }
  for (int i = 0; i < 8; ++i) {
    Attack([this, request](Stub& stub) {
      Note("read", CreateJob(stub, request, kAlice).status());
    });
  }
}

void HostileTenantTest::HoldUploadRoom() {
  // Of the sixteen uploads that it may have, so that there are too many with
  // those of known meshes.
  for (const char digit : std::string("0123456789ab")) {
    Attack([this, digit](Stub& stub) {
      CallContext context(kAlice);
      v1::UploadMeshResponse response;
      const auto writer = stub.UploadMesh(&context, &response);
      v1::UploadMeshRequest message;
      message.mutable_header()->set_sha256(std::string(64, digit));
      message.mutable_header()->set_size_bytes(kBudget / 32);
      bool open = writer->Write(message);
      message.set_chunk(std::string(1300, 'x'));
      while (open && !stop_) {
        absl::SleepFor(absl::Milliseconds(100));
        open = writer->Write(message);
        if (open) Note("hold an upload", "OK");
      }
      context.TryCancel();
      const grpc::Status end = writer->Finish();
      if (!stop_) Note("hold an upload", OutcomeOfCall(end));
    });
  }
}

void HostileTenantTest::OpenKnownUploads() {
  for (int i = 0; i < 8; ++i) {
    Attack([this](Stub& stub) {
      Note("open a known upload", UploadMesh(stub, large_mesh_, kAlice));
    });
  }
}

void HostileTenantTest::SendBytes(const std::string& method,
                                  const std::string& bytes,
                                  const std::string& key) {
  attackers_.emplace_back([this, method, bytes, key] {
    grpc::GenericStub stub(server_->Connect());
    while (!stop_) {
      CallContext context(key);
      const grpc::Slice slice(bytes);
      grpc::CompletionQueue queue;
      const auto call = stub.PrepareUnaryCall(
          &context, absl::StrCat("/isomatch.v1.CorrespondenceService/", method),
          grpc::ByteBuffer(&slice, 1), &queue);
      call->StartCall();
      grpc::ByteBuffer response;
      grpc::Status status;
      call->Finish(&response, &status, nullptr);
      void* tag = nullptr;
      bool ok = false;
      queue.Next(&tag, &ok);
      Note(method, status.ok() ? "OK" : ErrorOf(status).reason);
    }
  });
}

/// Bytes of 2,000,000 messages of the field, all empty, after `first`.
std::string EmptyFields(const std::string& tag, std::string first = "") {
  first.reserve(first.size() + 4'000'000);
  for (int i = 0; i < 2'000'000; ++i) {
    first += tag;
    first += '\0';
  }
  return first;
}

void HostileTenantTest::SendManyFields() {
  const std::string kLandmarks = "\x1a";
  const std::string kUnknown = "\x7a";
  for (int i = 0; i < 2; ++i) {
    SendBytes("CreateJob", EmptyFields(kLandmarks), kAlice);
    SendBytes("WatchJob", EmptyFields(kUnknown, "\x0a\x06jobs/1"), kAlice);
    SendBytes("UploadMesh", EmptyFields(kUnknown, "\x12\x01x"), kAlice);
    SendBytes("GetServerInfo", EmptyFields(kUnknown), "");
  }
}

void HostileTenantTest::FillTheStore() {
  Attack([this, number = 0](Stub& stub) mutable {
    std::string bytes(4 << 20, 'u');
    bytes.replace(0, 8, absl::StrCat(absl::Dec(++number, absl::kZeroPad8)));
    Note("fill the store", UploadMesh(stub, bytes, kAlice));
    absl::SleepFor(absl::Milliseconds(50));
  });
}

int HostileTenantTest::CountStarted(const std::string& key) {
  CallContext context(key);
  v1::ListJobsRequest request;
  request.add_states(v1::Job::STATE_RUNNING);
  request.add_states(v1::Job::STATE_SUCCEEDED);
  v1::ListJobsResponse response;
  const grpc::Status status =
      server_->stub().ListJobs(&context, request, &response);
  EXPECT_TRUE(status.ok()) << status.error_message();
  return response.jobs_size();
}

void HostileTenantTest::DoAllHarm() {
  ReadLargeMeshes();
  CreateAndCancel();
  FillTheQueue();
  HoldUploadRoom();
  OpenKnownUploads();
  SendManyFields();
  FillTheStore();
}

void HostileTenantTest::ExpectThatAttacksTookHold() {
  EXPECT_GT(CountStarted(kAlice), 0);
  EXPECT_EQ(MissingAnswers(), "");
  MutexLock lock(mutex_);
  PrintFigure("hostile tenant: attacks", attacks_, "");
}

TEST_F(HostileTenantTest, AllAttacksAtOnceLeaveTheOtherTenantItsShare) {
  v1::CreateJobRequest first = JobOf(0);
  first.set_request_id("first");
  const auto kept = CreateJob(server_->stub(), first, kBob);
  ASSERT_TRUE(kept.ok()) << kept.status();
  ASSERT_EQ(WaitForEnd(server_->stub(), kept->name(), kBob)->state(),
            v1::Job::STATE_SUCCEEDED);
  WatchMemory();
  DoAllHarm();
  const absl::Time begin = absl::Now();
  const absl::Duration least = absl::Seconds(IsSoak() ? 60 : 3);
  const auto goes_on = [&] {
    const absl::Duration passed = absl::Now() - begin;
    return passed < least ||
           (passed < absl::Minutes(1) && !MissingAnswers().empty());
  };
  const int jobs = Rounds("ISOMATCH_HOSTILE_JOBS", 5, 20);
  Latencies creates;
  Latencies waits;
  int succeeded = 0;
  for (int i = 0; i < jobs || goes_on(); ++i) {
    v1::CreateJobRequest request = JobOf(i);
    request.set_validate_only(i >= jobs);
    const absl::Time asked = absl::Now();
    const auto job = CreateJob(server_->stub(), request, kBob);
    creates.Add(absl::Now() - asked);
    ASSERT_TRUE(job.ok()) << job.status();
    if (request.validate_only()) {
      absl::SleepFor(absl::Milliseconds(20));
      continue;
    }
    const auto end = WaitForEnd(server_->stub(), job->name(), kBob);
    ASSERT_TRUE(end.ok()) << end.status();
    waits.Add(absl::Now() - asked);
    if (end->state() == v1::Job::STATE_SUCCEEDED) ++succeeded;
    EXPECT_TRUE(
        UploadMesh(server_->stub(), absl::StrCat("of bob ", i), kBob).ok());
  }
  StopAll();
  ExpectThatAttacksTookHold();
  ExpectAtMost("hostile tenant: jobs of the other that did not succeed",
               jobs - succeeded, 0, "");
  ExpectAtMost("hostile tenant: CreateJob of the other, p99",
               creates.Milliseconds(0.99), 1000, "ms");
  PrintFigure("hostile tenant: CreateJob of the other, median",
              creates.Milliseconds(0.5), "ms");
  PrintFigure("hostile tenant: a job of the other, slowest",
              waits.Milliseconds(1), "ms");
  ExpectAtMost("hostile tenant: server's memory beyond its budget",
               static_cast<double>(most_bytes_ - kBudget) / kMebibyte, 256,
               "MiB");
  // Its results are there, and its retries find them.
  const auto again = CreateJob(server_->stub(), first, kBob);
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->name(), kept->name());
  EXPECT_TRUE(
      Download(server_->stub(), kept->name(), v1::RESULT_PART_MAP, 0, kBob)
          .ok());
}

}  // namespace
}  // namespace isomatch
