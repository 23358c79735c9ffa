// Two tenants: Alice does all harm that her key allows, at once; Bob works.

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include <grpcpp/generic/generic_stub.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "server/storage/sha256.h"
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

v1::CreateJobRequest JobOf(int seed) {
  v1::CreateJobRequest request;
  *request.mutable_mesh_x() = ToDraco(BumpySphere(1));
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

class HostileTenantTest : public testing::Test {
 protected:
  HostileTenantTest() {
    std::string keys;
    for (const char* name : {kAlice, kBob}) {
      absl::StrAppend(&keys, name, " ", name, " submit ", Sha256Hex(name),
                      "\n");
    }
    server_ = std::make_unique<SoakServer>(
        std::vector<std::string>{"--api-keys", folder_.Write("keys", keys),
                                 "--memory-budget", absl::StrCat(kBudget)});
  }

  ~HostileTenantTest() override { StopAll(); }

  /// Runs `attack` again and again, with a connection of its own.
  void Attack(const std::function<void(Stub&)>& attack) {
    attackers_.emplace_back([this, attack] {
      const auto stub = v1::CorrespondenceService::NewStub(server_->Connect());
      while (!stop_) {
        attack(*stub);
        ++attacks_;
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

  void CreateAndCancel();
  void FillTheQueue();
  void ReadLargeMeshes();
  void HoldUploadRoom();
  void SendEmptyLandmarks();
  void FillTheStore();

  const TemporaryFolder folder_;
  std::unique_ptr<SoakServer> server_;
  std::atomic<bool> stop_ = false;
  std::atomic<int> attacks_ = 0;
  std::int64_t most_bytes_ = 0;
  std::vector<std::thread> attackers_;
};

void HostileTenantTest::CreateAndCancel() {
  Attack([](Stub& stub) {
    const auto job = CreateJob(stub, JobOf(1), kAlice);
    if (job.ok()) (void)CancelJob(stub, job->name(), kAlice);
  });
}

void HostileTenantTest::FillTheQueue() {
  Attack([seed = 0](Stub& stub) mutable {
    v1::CreateJobRequest request = JobOf(++seed);
    request.set_priority(100);
    if (!CreateJob(stub, request, kAlice).ok()) {
      absl::SleepFor(absl::Milliseconds(10));
    }
  });
}

grpc::Status UploadAs(Stub& stub, const std::string& bytes,
                      const std::string& key) {
  CallContext context(key);
  v1::UploadMeshResponse response;
  const auto writer = stub.UploadMesh(&context, &response);
  v1::UploadMeshRequest message;
  message.mutable_header()->set_sha256(Sha256Hex(bytes));
  message.mutable_header()->set_size_bytes(bytes.size());
  writer->Write(message);
  for (std::size_t sent = 0; sent < bytes.size(); sent += 1 << 20) {
    message.set_chunk(bytes.substr(sent, 1 << 20));
    if (!writer->Write(message)) break;
  }
  writer->WritesDone();
  return writer->Finish();
}

void HostileTenantTest::ReadLargeMeshes() {
  const v1::Mesh mesh = ToDraco(WavyGrid(IsSoak() ? 1000 : 200));
  ASSERT_TRUE(UploadAs(server_->stub(), mesh.draco(), kAlice).ok());
  v1::CreateJobRequest request;
  request.set_validate_only(true);
  for (v1::Mesh* const side :
       {request.mutable_mesh_x(), request.mutable_mesh_y()}) {
    side->mutable_digest()->set_sha256(Sha256Hex(mesh.draco()));
    side->mutable_digest()->set_size_bytes(mesh.draco().size());
  }
  for (int i = 0; i < 8; ++i) {
    Attack([request](Stub& stub) { (void)CreateJob(stub, request, kAlice); });
  }
}

void HostileTenantTest::HoldUploadRoom() {
  for (const char digit : {'a', 'b', 'c'}) {
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
      }
      context.TryCancel();
      writer->Finish();
    });
  }
}

void HostileTenantTest::SendEmptyLandmarks() {
  std::string bytes;
  while (bytes.size() < 4'000'000) bytes += std::string("\x1a\x00", 2);
  for (int i = 0; i < 2; ++i) {
    attackers_.emplace_back([this, bytes] {
      grpc::GenericStub stub(server_->Connect());
      while (!stop_) {
        CallContext context(kAlice);
        const grpc::Slice slice(bytes);
        grpc::CompletionQueue queue;
        const auto call = stub.PrepareUnaryCall(
            &context, "/isomatch.v1.CorrespondenceService/CreateJob",
            grpc::ByteBuffer(&slice, 1), &queue);
        call->StartCall();
        grpc::ByteBuffer response;
        grpc::Status status;
        call->Finish(&response, &status, nullptr);
        void* tag = nullptr;
        bool ok = false;
        queue.Next(&tag, &ok);
        EXPECT_FALSE(status.ok());
        ++attacks_;
      }
    });
  }
}

void HostileTenantTest::FillTheStore() {
  Attack([number = 0](Stub& stub) mutable {
    std::string bytes(4 << 20, 'u');
    bytes.replace(0, 8, absl::StrCat(absl::Dec(++number, absl::kZeroPad8)));
    (void)UploadAs(stub, bytes, kAlice);
    absl::SleepFor(absl::Milliseconds(50));
  });
}

TEST_F(HostileTenantTest, AllAttacksAtOnceLeaveTheOtherTenantItsShare) {
  v1::CreateJobRequest first = JobOf(0);
  first.set_request_id("first");
  const auto kept = CreateJob(server_->stub(), first, kBob);
  ASSERT_TRUE(kept.ok()) << kept.status();
  ASSERT_EQ(WaitForEnd(server_->stub(), kept->name(), kBob)->state(),
            v1::Job::STATE_SUCCEEDED);
  WatchMemory();
  ReadLargeMeshes();
  CreateAndCancel();
  FillTheQueue();
  HoldUploadRoom();
  SendEmptyLandmarks();
  FillTheStore();
  const absl::Time begin = absl::Now();
  const absl::Duration least = absl::Seconds(IsSoak() ? 60 : 3);
  const int jobs = Rounds("ISOMATCH_HOSTILE_JOBS", 5, 20);
  Latencies creates;
  Latencies waits;
  int succeeded = 0;
  for (int i = 0; i < jobs || absl::Now() < begin + least; ++i) {
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
        UploadAs(server_->stub(), absl::StrCat("of bob ", i), kBob).ok());
  }
  StopAll();
  PrintFigure("hostile tenant: attacks", attacks_, "");
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
