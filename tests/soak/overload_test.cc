// All workers are busy and the queue is full.

#include <atomic>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "client/sample/sample_animal.h"
#include "core/base/sha256.h"
#include "tests/server/test_server.h"
#include "tests/soak/figures.h"
#include "tests/soak/known_jobs.h"
#include "tests/soak/soak_server.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

void Set(absl::Duration duration, google::protobuf::Duration& proto) {
  constexpr std::int64_t kMillis = 1'000'000;  // nanoseconds
  const std::int64_t milliseconds = absl::ToInt64Milliseconds(duration);
  proto.set_seconds(milliseconds / 1000);
  proto.set_nanos(static_cast<std::int32_t>(milliseconds % 1000 * kMillis));
}

v1::CreateJobRequest SmallJob() {
  v1::CreateJobRequest request;
  *request.mutable_mesh_x() = ToDraco(Tetrahedron());
  *request.mutable_mesh_y() = request.mesh_x();
  return request;
}

/// Starts a job that takes a worker for long.
std::string Occupy(Stub& stub) {
  const auto job = CreateJob(stub, LongJob());
  EXPECT_TRUE(job.ok()) << job.status();
  WaitUntilRuns(stub, job->name());
  return job->name();
}

/// Uploads one mesh of 4 MiB after the other.
void UploadUntil(const std::atomic<bool>& stop, SoakServer& server) {
  const std::shared_ptr<grpc::Channel> channel = server.Connect();
  const auto stub = v1::CorrespondenceService::NewStub(channel);
  for (int i = 0; !stop; ++i) {
    std::string bytes(4 << 20, 'u');
    bytes.replace(0, 8, absl::StrCat(absl::Dec(i, absl::kZeroPad8)));
    EXPECT_EQ(UploadMesh(*stub, bytes), absl::OkStatus());
    absl::SleepFor(absl::Milliseconds(100));
  }
}

/// Calls of one client to a server whose queue is full.
struct Refusals {
  std::vector<absl::Duration> took;
  /// How often health was not SERVING.
  int unhealthy = 0;
};

Refusals Overload(SoakServer& server, int calls) {
  const std::shared_ptr<grpc::Channel> channel = server.Connect();
  const auto stub = v1::CorrespondenceService::NewStub(channel);
  const v1::CreateJobRequest request = SmallJob();
  Refusals refusals;
  for (int i = 0; i < calls; ++i) {
    CallContext context;
    v1::CreateJobResponse response;
    const absl::Time begin = absl::Now();
    const grpc::Status status = stub->CreateJob(&context, request, &response);
    refusals.took.push_back(absl::Now() - begin);
    const CallError error = ErrorOf(status);
    EXPECT_EQ(error.code, grpc::StatusCode::RESOURCE_EXHAUSTED);
    EXPECT_EQ(error.reason, "QUEUE_FULL");
    EXPECT_TRUE(error.has_retry);
    if (i % 10 == 0 && !IsServing(channel)) ++refusals.unhealthy;
    absl::SleepFor(absl::Milliseconds(5));
  }
  return refusals;
}

TEST(OverloadTest, AFullQueueRefusesQuicklyAndTheServerStaysHealthy) {
  SoakServer server({"--max-queued-jobs", "20"});
  Occupy(server.stub());
  const v1::CreateJobRequest request = SmallJob();
  for (int i = 0; i < 20; ++i) {
    ASSERT_TRUE(CreateJob(server.stub(), request).ok());
  }
  std::atomic<bool> stop = false;
  std::thread uploads([&] { UploadUntil(stop, server); });
  // Quick runs have one core, if that.
  const int num_clients = IsSoak() ? 8 : 2;
  const int calls = Rounds("ISOMATCH_OVERLOAD_CALLS", 320, 4800) / num_clients;
  std::vector<Refusals> of_clients(static_cast<size_t>(num_clients));
  std::vector<std::thread> clients;
  for (Refusals& refusals : of_clients) {
    clients.emplace_back([&] { refusals = Overload(server, calls); });
  }
  for (std::thread& client : clients) client.join();
  stop = true;
  uploads.join();
  Latencies refusals;
  int unhealthy = 0;
  for (const Refusals& client : of_clients) {
    for (const absl::Duration took : client.took) refusals.Add(took);
    unhealthy += client.unhealthy;
  }
  PrintFigure("overload: refusal, median", refusals.Milliseconds(0.5), "ms");
  PrintFigure("overload: refusal, slowest", refusals.Milliseconds(1), "ms");
  ExpectAtMost("overload: refusal, p99", refusals.Milliseconds(0.99), 20, "ms");
  ExpectAtMost("overload: health not SERVING", unhealthy, 0, "");
}

TEST(OverloadTest, QueueTimeoutsHoldWhileAllWorkersAreBusy) {
  SoakServer server({"--max-queued-jobs", "1000", "--workers", "2"});
  Occupy(server.stub());
  Occupy(server.stub());
  std::mt19937_64 random(PrintedSeed());
  std::uniform_int_distribution<int> milliseconds(200, 3000);
  Latencies late;
  std::vector<std::pair<std::string, absl::Duration>> jobs;
  const int count = Rounds("ISOMATCH_TIMEOUTS", 40, 400);
  for (int i = 0; i < count; ++i) {
    v1::CreateJobRequest request = SmallJob();
    const absl::Duration timeout = absl::Milliseconds(milliseconds(random));
    Set(timeout, *request.mutable_queue_timeout());
    const auto job = CreateJob(server.stub(), request);
    ASSERT_TRUE(job.ok()) << job.status();
    jobs.emplace_back(job->name(), timeout);
  }
  for (const auto& [name, timeout] : jobs) {
    const auto job = WaitForEnd(server.stub(), name);
    ASSERT_TRUE(job.ok()) << job.status();
    ASSERT_EQ(job->error().reason(), "QUEUE_TIMEOUT");
    const absl::Duration lived =
        ToTime(job->end_time()) - ToTime(job->create_time());
    EXPECT_GE(lived, timeout - absl::Milliseconds(1));
    late.Add(lived - timeout);
  }
  ExpectAtMost("queue timeout: slowest beyond it", late.Milliseconds(1), 100,
               "ms");
}

TEST(OverloadTest, RunTimeoutsHoldWhileAllWorkersAreBusy) {
  SoakServer server({"--workers", "2"});
  std::mt19937_64 random(PrintedSeed());
  std::uniform_int_distribution<int> milliseconds(100, 1200);
  Latencies late;
  std::vector<std::pair<std::string, absl::Duration>> jobs;
  const int count = Rounds("ISOMATCH_RUN_TIMEOUTS", 8, 80);
  for (int i = 0; i < count; ++i) {
    v1::CreateJobRequest request = LongJob();
    const absl::Duration timeout = absl::Milliseconds(milliseconds(random));
    Set(timeout, *request.mutable_run_timeout());
    const auto job = CreateJob(server.stub(), request);
    ASSERT_TRUE(job.ok()) << job.status();
    jobs.emplace_back(job->name(), timeout);
  }
  for (const auto& [name, timeout] : jobs) {
    const auto job = WaitForEnd(server.stub(), name);
    ASSERT_TRUE(job.ok()) << job.status();
    ASSERT_EQ(job->error().reason(), "RUN_TIMEOUT");
    const absl::Duration ran =
        ToTime(job->end_time()) - ToTime(job->start_time());
    EXPECT_GE(ran, timeout - absl::Milliseconds(1));
    late.Add(ran - timeout);
  }
  ExpectAtMost("run timeout: slowest beyond it", late.Milliseconds(1), 100,
               "ms");
}

/// Cancels a job some time after it started; returns how long it takes until
/// neither worker nor memory is held, from the call on; nullopt for a job that
/// had ended by then.
std::optional<absl::Duration> CancelAfter(Stub& stub,
                                          const v1::CreateJobRequest& request,
                                          absl::Duration wait) {
  const auto job = CreateJob(stub, request);
  EXPECT_TRUE(job.ok()) << job.status();
  WaitUntilRuns(stub, job->name());
  absl::SleepFor(wait);
  const absl::Time begin = absl::Now();
  if (!CancelJob(stub, job->name()).ok()) return std::nullopt;
  while (absl::Now() < begin + absl::Seconds(30)) {
    const v1::GetServerInfoResponse info = GetInfo(stub);
    if (info.running_jobs() == 0 && info.memory_reserved_bytes() == 0) break;
    absl::SleepFor(absl::Milliseconds(1));
  }
  return absl::Now() - begin;
}

TEST(OverloadTest, ACancelledJobGivesItsWorkerAndMemoryBack) {
  SoakServer server;
  const v1::CreateJobRequest paper = LongJob();
  v1::CreateJobRequest quick = LongJob();
  quick.mutable_options()->set_profile(v1::PROFILE_DEFAULT);
  std::mt19937_64 random(PrintedSeed());
  std::uniform_real_distribution<double> seconds(0, IsSoak() ? 2.5 : 0.6);
  Latencies stops;
  std::int64_t warm_bytes = 0;
  int cancelled = 0;
  const int count = Rounds("ISOMATCH_CANCELS", 12, 200);
  for (int i = 0; i < count; ++i) {
    // Every tenth time later, to meet the later stages of the paper's way.
    const absl::Duration wait =
        absl::Seconds(seconds(random)) * (IsSoak() && i % 10 == 9 ? 12 : 1);
    const v1::CreateJobRequest& request = i % 2 == 0 ? quick : paper;
    const auto took = CancelAfter(server.stub(), request, wait);
    if (took) stops.Add(*took);
    cancelled += took.has_value() ? 1 : 0;
    if (i == count / 2) warm_bytes = server.ResidentBytes();
  }
  PrintFigure("cancel: jobs that had not ended by then", cancelled, "");
  ASSERT_GT(cancelled, count / 4);
  PrintFigure("cancel: median", stops.Milliseconds(0.5), "ms");
  PrintFigure("cancel: slowest", stops.Milliseconds(1), "ms");
  ExpectAtMost("cancel: until worker and memory are free, p99",
               stops.Milliseconds(0.99), 250, "ms");
  PrintFigure(
      "cancel: resident memory, second half of the cancels",
      static_cast<double>(server.ResidentBytes() - warm_bytes) / kMebibyte,
      "MiB");
}

/// A mesh that the server has by now.
v1::Mesh UploadedAnimal(Stub& stub, char pose, int vertices) {
  const auto sample = MakeSample({.pose = pose, .vertices = vertices});
  EXPECT_TRUE(sample.ok()) << sample.status();
  v1::Mesh mesh = ToDraco(sample->mesh);
  EXPECT_EQ(UploadMesh(stub, mesh.draco()), absl::OkStatus());
  v1::Digest digest;
  digest.set_sha256(Sha256Hex(mesh.draco()));
  digest.set_size_bytes(mesh.draco().size());
  *mesh.mutable_digest() = digest;
  return mesh;
}

TEST(OverloadTest, ACancelledJobOfLargeMeshesDoesSoToo) {
  // So that each job prepares its meshes.
  SoakServer server(
      {"--prepared-cache-bytes", "0", "--prepared-store-bytes", "0"});
  const int vertices = IsSoak() ? 200'000 : 20'000;
  v1::CreateJobRequest request;
  *request.mutable_mesh_x() = UploadedAnimal(server.stub(), 'A', vertices);
  *request.mutable_mesh_y() = UploadedAnimal(server.stub(), 'B', vertices);
  std::mt19937_64 random(PrintedSeed());
  std::uniform_real_distribution<double> seconds(0, IsSoak() ? 2 : 0.3);
  Latencies stops;
  const int count = Rounds("ISOMATCH_LARGE_CANCELS", 4, 100);
  for (int i = 0; i < count; ++i) {
    const auto took =
        CancelAfter(server.stub(), request, absl::Seconds(seconds(random)));
    if (took) stops.Add(*took);
  }
  const std::string large = absl::StrCat("cancel of ", vertices, " vertices");
  PrintFigure(large + ": jobs that had not ended by then", stops.count(), "");
  ASSERT_GT(stops.count(), count / 4);
  PrintFigure(large + ": median", stops.Milliseconds(0.5), "ms");
  PrintFigure(large + ": p90", stops.Milliseconds(0.9), "ms");
  PrintFigure(large + ": slowest", stops.Milliseconds(1), "ms");
  ExpectAtMost(large + ": p99", stops.Milliseconds(0.99), 250, "ms");
}

}  // namespace
}  // namespace isomatch
