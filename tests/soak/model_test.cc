// Random operations, of two tenants, against a model in memory, while the
// server is stopped or killed now and then. One client: after each operation
// server and model must agree.

#include <algorithm>
#include <array>
#include <csignal>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/sha256.h"
#include "tests/server/test_server.h"
#include "tests/soak/figures.h"
#include "tests/soak/job_model.h"
#include "tests/soak/known_jobs.h"
#include "tests/soak/soak_server.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

/// A list that was turned to some page.
struct OpenList {
  v1::ListJobsRequest next;
  /// Number of the last job that was seen.
  int before;
};

struct Tenant {
  std::string key;
  JobModel model;
  std::optional<OpenList> list = {};
  /// Of jobs that were deleted.
  std::vector<std::string> free_request_ids = {};
};

/// SHA-256 of the meshes of a request.
std::set<std::string> MeshesOf(const v1::CreateJobRequest& request) {
  const auto of = [](const v1::Mesh& mesh) {
    return mesh.has_digest() ? mesh.digest().sha256() : Sha256Hex(mesh.draco());
  };
  return {of(request.mesh_x()), of(request.mesh_y())};
}

class ModelTest : public testing::Test {
 protected:
  static constexpr int kKinds = 24;
  static constexpr size_t kMostJobs = 30;

  ModelTest();

  void Start() { server_ = std::make_unique<SoakServer>(flags_); }
  void Restart();
  void Step();

  // The operations.
  void Create(Tenant& tenant);
  void CreateAgain(Tenant& tenant);
  void Get(Tenant& tenant);
  void List(Tenant& tenant);
  void TurnPage(Tenant& tenant);
  void Cancel(Tenant& tenant);
  void Delete(Tenant& tenant);
  void Delete(Tenant& tenant, const ModelJob& job);
  void DownloadPart(Tenant& tenant);
  void Watch(Tenant& tenant);
  void FindMissing(Tenant& tenant);
  void Upload(Tenant& tenant);

  // Their parts.
  v1::CreateJobRequest RandomRequest(Tenant& tenant, std::optional<int>& kind);
  v1::ListJobsRequest RandomFilter();
  v1::ListJobsResponse Page(const Tenant& tenant,
                            const v1::ListJobsRequest& request);
  std::vector<v1::Job> RestOf(const Tenant& tenant,
                              v1::ListJobsRequest request);
  void Refresh(Tenant& tenant, const std::string& name);
  void CheckAll();

  Stub& stub() { return server_->stub(); }
  int Random(int bound) {
    return std::uniform_int_distribution<int>(0, bound - 1)(random_);
  }
  bool OneIn(int times) { return Random(times) == 0; }
  const std::string& RandomMesh() {
    const auto& request = known_.request(Random(kKinds));
    return OneIn(2) ? request.mesh_x().draco() : request.mesh_y().draco();
  }
  void Expect(bool holds, const std::string& what) {
    EXPECT_TRUE(holds) << "ISOMATCH_SEED=" << seed_ << ", step " << step_
                       << ": " << what;
  }
  void ExpectNone(const std::string& problem) {
    Expect(problem.empty(), problem);
  }

  const TemporaryFolder folder_;
  const std::uint64_t seed_ = PrintedSeed();
  std::mt19937_64 random_{seed_};
  const KnownJobs known_{kKinds};
  v1::CreateJobRequest slow_;
  std::array<Tenant, 2> tenants_;
  std::vector<std::string> flags_;
  std::unique_ptr<SoakServer> server_;
  int step_ = 0;
  int jobs_ = 0;
  int restarts_ = 0;
};

ModelTest::ModelTest()
    : tenants_{Tenant{"key of one", JobModel("one", &known_)},
               Tenant{"key of two", JobModel("two", &known_)}} {
  *slow_.mutable_mesh_x() = ToDraco(BumpySphere(/*levels=*/3));
  *slow_.mutable_mesh_y() = slow_.mesh_x();
  std::string keys;
  for (const Tenant& tenant : tenants_) {
    const std::string name = tenant.key.substr(sizeof("key of"));
    absl::StrAppend(&keys, name, " ", name, " submit ", Sha256Hex(tenant.key),
                    "\n");
  }
  flags_ = {"--data-dir",        folder_.Path("data"),
            "--api-keys",        folder_.Write("keys.txt", keys),
            "--workers",         "2",
            "--threads-per-job", "1",
            "--drain-timeout",   "100ms",
            "--max-kept-jobs",   "1000000"};
  Start();
}

void ModelTest::Restart() {
  // Lists stay open while the newest jobs go, and others come later.
  for (Tenant& tenant : tenants_) {
    if (!tenant.list) TurnPage(tenant);
    for (int i = Random(4); i > 0 && !tenant.model.jobs().empty(); --i) {
      Delete(tenant, tenant.model.jobs().rbegin()->second);
    }
  }
  const bool kill = OneIn(2);
  server_->Signal(kill ? SIGKILL : SIGTERM);
  EXPECT_EQ(server_->ExitStatus(), kill ? -1 : 0);
  ++restarts_;
  Start();
  CheckAll();
}

void ModelTest::CheckAll() {
  for (Tenant& tenant : tenants_) {
    const v1::ListJobsRequest all;
    ExpectNone(tenant.model.CompareList(all, std::numeric_limits<int>::max(),
                                        RestOf(tenant, all), restarts_));
  }
}

v1::CreateJobRequest ModelTest::RandomRequest(Tenant& tenant,
                                              std::optional<int>& kind) {
  constexpr int kMillisecond = 1'000'000;  // nanoseconds
  v1::CreateJobRequest request = slow_;
  if (!OneIn(100)) {
    kind = Random(kKinds);
    request = known_.request(*kind);
  }
  if (!kind || OneIn(15)) {
    request.mutable_run_timeout()->set_nanos((1 + Random(300)) * kMillisecond);
  }
  if (OneIn(15)) {
    request.mutable_queue_timeout()->set_nanos((1 + Random(50)) * kMillisecond);
  }
  for (const char* label : {"a", "b"}) {
    if (OneIn(2)) {
      (*request.mutable_labels())[label] = OneIn(2) ? "1" : "2";
    }
  }
  request.set_priority(Random(5) - 2);
  request.set_validate_only(OneIn(20));
  if (OneIn(4)) return request;
  request.set_request_id(UniqueRequestId());
  if (!tenant.free_request_ids.empty() && OneIn(5)) {
    request.set_request_id(tenant.free_request_ids.back());
    tenant.free_request_ids.pop_back();
  }
  return request;
}

void ModelTest::Create(Tenant& tenant) {
  if (tenant.model.jobs().size() >= kMostJobs) return Delete(tenant);
  std::optional<int> kind;
  v1::CreateJobRequest request = RandomRequest(tenant, kind);
  const std::string sha256_x = Sha256Hex(request.mesh_x().draco());
  const std::string sha256_y = Sha256Hex(request.mesh_y().draco());
  bool is_there = true;
  if (OneIn(5)) {
    v1::Digest digest;
    digest.set_sha256(sha256_x);
    digest.set_size_bytes(request.mesh_x().draco().size());
    *request.mutable_mesh_x()->mutable_digest() = digest;
    is_there = tenant.model.meshes.count(sha256_x) != 0;
  }
  const auto job = CreateJob(stub(), request, tenant.key);
  if (!is_there) {
    return Expect(ReasonOf(job.status()) == "MESH_MISSING",
                  job.status().ToString());
  }
  Expect(job.ok(), job.status().ToString());
  if (!job.ok()) return;
  if (request.validate_only()) return Expect(job->name().empty(), "validated");
  tenant.model.meshes.insert({sha256_x, sha256_y});
  ExpectNone(tenant.model.Add(request, kind, ++jobs_, *job));
  ExpectNone(tenant.model.Observe(*job, restarts_));
}

void ModelTest::CreateAgain(Tenant& tenant) {
  const ModelJob* const job = tenant.model.Pick(random_());
  if (job == nullptr || job->request.request_id().empty()) return;
  v1::CreateJobRequest request = job->request;
  if (OneIn(3)) {
    request.set_priority(request.priority() + 1);
    const auto other = CreateJob(stub(), request, tenant.key);
    return Expect(ReasonOf(other.status()) == "REQUEST_ID_REUSED",
                  other.status().ToString());
  }
  const std::string name = job->last.name();
  const auto same = CreateJob(stub(), request, tenant.key);
  Expect(same.ok() && same->name() == name, same.status().ToString());
  if (same.ok()) ExpectNone(tenant.model.Observe(*same, restarts_));
}

void ModelTest::Refresh(Tenant& tenant, const std::string& name) {
  const auto job = GetJob(stub(), name, tenant.key);
  Expect(job.ok(), job.status().ToString());
  if (job.ok()) ExpectNone(tenant.model.Observe(*job, restarts_));
}

void ModelTest::Get(Tenant& tenant) {
  Tenant& owner = tenants_[static_cast<size_t>(Random(2))];
  const ModelJob* const job = owner.model.Pick(random_());
  if (job == nullptr) return;
  if (&owner == &tenant) return Refresh(tenant, job->last.name());
  const auto found = GetJob(stub(), job->last.name(), tenant.key);
  Expect(ReasonOf(found.status()) == "JOB_NOT_FOUND", "another tenant's");
}

v1::ListJobsRequest ModelTest::RandomFilter() {
  v1::ListJobsRequest request;
  for (const char* label : {"a", "b"}) {
    if (OneIn(4)) (*request.mutable_labels())[label] = OneIn(2) ? "1" : "2";
  }
  for (int state = 1; state <= 5 && OneIn(2); ++state) {
    request.add_states(static_cast<v1::Job::State>(state));
  }
  if (OneIn(2)) request.set_page_size(static_cast<std::uint32_t>(Random(12)));
  return request;
}

v1::ListJobsResponse ModelTest::Page(const Tenant& tenant,
                                     const v1::ListJobsRequest& request) {
  CallContext context(tenant.key);
  v1::ListJobsResponse page;
  const grpc::Status status = stub().ListJobs(&context, request, &page);
  Expect(status.ok(), status.error_message());
  return page;
}

std::vector<v1::Job> ModelTest::RestOf(const Tenant& tenant,
                                       v1::ListJobsRequest request) {
  std::vector<v1::Job> jobs;
  do {
    const v1::ListJobsResponse page = Page(tenant, request);
    jobs.insert(jobs.end(), page.jobs().begin(), page.jobs().end());
    request.set_page_token(page.next_page_token());
  } while (!request.page_token().empty());
  return jobs;
}

void ModelTest::List(Tenant& tenant) {
  const v1::ListJobsRequest request = RandomFilter();
  ExpectNone(tenant.model.CompareList(request, std::numeric_limits<int>::max(),
                                      RestOf(tenant, request), restarts_));
}

/// Opens a list, or goes on with one of some operations ago: since then jobs
/// may have gone and others come, and the server may be another process.
void ModelTest::TurnPage(Tenant& tenant) {
  if (tenant.list) {
    const OpenList list = *std::exchange(tenant.list, std::nullopt);
    return ExpectNone(tenant.model.CompareList(
        list.next, list.before, RestOf(tenant, list.next), restarts_));
  }
  v1::ListJobsRequest request = RandomFilter();
  request.set_page_size(static_cast<std::uint32_t>(1 + Random(4)));
  const v1::ListJobsResponse page = Page(tenant, request);
  if (page.next_page_token().empty()) return;
  request.set_page_token(page.next_page_token());
  const std::string& last = page.jobs(page.jobs_size() - 1).name();
  const ModelJob* const job = tenant.model.Find(last);
  Expect(job != nullptr, "unknown: " + last);
  if (job != nullptr) tenant.list = OpenList{request, job->number};
}

void ModelTest::Cancel(Tenant& tenant) {
  ModelJob* const job = tenant.model.Pick(random_());
  if (job == nullptr) return;
  const std::string name = job->last.name();
  const bool was_terminal = IsEnd(job->last.state());
  if (!was_terminal) job->cancel_asked = true;
  const auto cancelled = CancelJob(stub(), name, tenant.key);
  if (cancelled.ok()) {
    Expect(!was_terminal && cancelled->state() == v1::Job::STATE_CANCELLED,
           "cancelled: " + cancelled->ShortDebugString());
    return ExpectNone(tenant.model.Observe(*cancelled, restarts_));
  }
  Expect(ReasonOf(cancelled.status()) == "JOB_TERMINAL",
         cancelled.status().ToString());
  if (!was_terminal) job->cancel_asked = false;
  Refresh(tenant, name);
  Expect(IsEnd(job->last.state()), name + " is said to be terminal");
}

void ModelTest::Delete(Tenant& tenant) {
  const ModelJob* const job = tenant.model.Pick(random_());
  if (job != nullptr) Delete(tenant, *job);
}

void ModelTest::Delete(Tenant& tenant, const ModelJob& job) {
  const std::string name = job.last.name();
  const absl::Status deleted = DeleteJob(stub(), name, tenant.key);
  if (!deleted.ok()) {
    Expect(!IsEnd(job.last.state()) && ReasonOf(deleted) == "JOB_NOT_TERMINAL",
           deleted.ToString());
    return Refresh(tenant, name);
  }
  if (!job.request.request_id().empty()) {
    tenant.free_request_ids.push_back(job.request.request_id());
  }
  const std::set<std::string> meshes = MeshesOf(job.request);
  tenant.model.Remove(name);
  // Those that no other job names go with it.
  for (const std::string& mesh : meshes) {
    const bool is_named =
        std::ranges::any_of(tenant.model.jobs(), [&](const auto& numbered) {
          return MeshesOf(numbered.second.request).count(mesh) > 0;
        });
    if (!is_named) tenant.model.meshes.erase(mesh);
  }
  const auto found = GetJob(stub(), name, tenant.key);
  Expect(ReasonOf(found.status()) == "JOB_NOT_FOUND", name + " is deleted");
}

void ModelTest::DownloadPart(Tenant& tenant) {
  const ModelJob* const job = tenant.model.Pick(random_());
  if (job == nullptr || !job->kind) return;
  const auto part = static_cast<v1::ResultPart>(1 + Random(5));
  const auto& parts = known_.parts(*job->kind);
  const auto expected = parts.find(part);
  const int size =
      expected == parts.end() ? 0 : static_cast<int>(expected->second.size());
  const auto offset = static_cast<std::uint64_t>(Random(size + 2));
  const auto bytes =
      Download(stub(), job->last.name(), part, offset, tenant.key);
  if (!bytes.ok() && ReasonOf(bytes.status()) == "JOB_NOT_SUCCEEDED") {
    return Expect(job->last.state() != v1::Job::STATE_SUCCEEDED,
                  bytes.status().ToString());
  }
  if (expected == parts.end()) {
    return Expect(ReasonOf(bytes.status()) == "RESULT_PART_MISSING",
                  bytes.status().ToString());
  }
  if (offset > expected->second.size()) {
    return Expect(ReasonOf(bytes.status()) == "OFFSET_OUT_OF_RANGE",
                  bytes.status().ToString());
  }
  Expect(bytes.ok() && *bytes == expected->second.substr(offset),
         absl::StrCat("part ", part, ": ", bytes.status().ToString()));
}

void ModelTest::Watch(Tenant& tenant) {
  const ModelJob* const job = tenant.model.Pick(random_());
  if (job == nullptr) return;
  const auto end = WaitForEnd(stub(), job->last.name(), tenant.key);
  Expect(end.ok() && IsEnd(end->state()), end.status().ToString());
  if (end.ok()) ExpectNone(tenant.model.Observe(*end, restarts_));
}

void ModelTest::FindMissing(Tenant& tenant) {
  v1::FindMissingMeshesRequest request;
  std::set<std::string> missing;
  for (int i = 0; i < 5; ++i) {
    const std::string& mesh = RandomMesh();
    v1::Digest& digest = *request.add_digests();
    digest.set_sha256(Sha256Hex(mesh));
    digest.set_size_bytes(mesh.size());
    if (tenant.model.meshes.count(digest.sha256()) == 0) {
      missing.insert(digest.sha256());
    }
  }
  CallContext context(tenant.key);
  v1::FindMissingMeshesResponse response;
  const grpc::Status status =
      stub().FindMissingMeshes(&context, request, &response);
  Expect(status.ok(), status.error_message());
  std::set<std::string> found;
  for (const v1::Digest& digest : response.missing()) {
    found.insert(digest.sha256());
  }
  Expect(found == missing,
         absl::StrCat(found.size(), " missing, not ", missing.size()));
}

void ModelTest::Upload(Tenant& tenant) {
  const std::string& mesh = RandomMesh();
  CallContext context(tenant.key);
  v1::UploadMeshResponse response;
  const auto writer = stub().UploadMesh(&context, &response);
  v1::UploadMeshRequest message;
  message.mutable_header()->set_sha256(Sha256Hex(mesh));
  message.mutable_header()->set_size_bytes(mesh.size());
  writer->Write(message);
  message.set_chunk(mesh);
  writer->Write(message);
  writer->WritesDone();
  const grpc::Status status = writer->Finish();
  Expect(status.ok(), status.error_message());
  const bool is_new =
      tenant.model.meshes.insert(response.digest().sha256()).second;
  Expect(response.known() == !is_new, "known");
}

void ModelTest::Step() {
  using Operation = void (ModelTest::*)(Tenant&);
  struct Weighted {
    int weight;
    Operation operation;
  };
  constexpr Weighted kOperations[] = {
      {16, &ModelTest::Create},  {5, &ModelTest::CreateAgain},
      {34, &ModelTest::Get},     {8, &ModelTest::List},
      {5, &ModelTest::TurnPage}, {5, &ModelTest::Cancel},
      {9, &ModelTest::Delete},   {8, &ModelTest::DownloadPart},
      {2, &ModelTest::Watch},    {4, &ModelTest::FindMissing},
      {4, &ModelTest::Upload},
  };
  constexpr int kWeights = 100;
  int at = Random(kWeights);
  for (const auto& [weight, operation] : kOperations) {
    at -= weight;
    if (at >= 0) continue;
    return (this->*operation)(tenants_[static_cast<size_t>(Random(2))]);
  }
}

TEST_F(ModelTest, ServerAndModelAgreeAfterEachOperation) {
  const int operations = Rounds("ISOMATCH_OPERATIONS", 5000, 200'000);
  const int per_restart = Rounds("ISOMATCH_OPERATIONS_PER_RESTART", 250, 500);
  for (step_ = 0; step_ < operations && !HasFailure(); ++step_) {
    if (OneIn(per_restart)) Restart();
    Step();
    if (step_ % 50 == 0) CheckAll();
  }
  PrintFigure("model: operations", step_, "");
  PrintFigure("model: jobs", jobs_, "");
  PrintFigure("model: restarts", restarts_, "");
  ExpectAtMost("model: disagreements", HasFailure() ? 1 : 0, 0, "");
}

}  // namespace
}  // namespace isomatch
