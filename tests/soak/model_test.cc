// Random operations, of two tenants, against a model in memory, while the
// server is stopped or killed now and then: one process, or a cluster. One
// client: after each operation server and model must agree.
//
// A call to a cluster may hear no answer. Then it is repeated until it does, as
// clients do, and it is not known whether it was done before, or twice:
//  - what has a request_id is done once, and so is what asks only;
//  - a job without one may have been made by each call. The client finds those
//    in the list, where they stand right before that of the last call;
//  - what was cancelled may be said to be over, what was deleted to be unknown,
//    what was uploaded to be known.

#include <algorithm>
#include <limits>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/sha256.h"
#include "tests/soak/figures.h"
#include "tests/soak/job_model.h"
#include "tests/soak/known_jobs.h"
#include "tests/soak/model_server.h"
#include "tests/soak/random_requests.h"
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

absl::Status StatusOf(const absl::Status& status) { return status; }
template <typename Value>
absl::Status StatusOf(const absl::StatusOr<Value>& value) {
  return value.status();
}

enum class ServerKind { kOne, kCluster };

class ModelTest : public testing::TestWithParam<ServerKind> {
 protected:
  static constexpr int kKinds = 24;
  static constexpr size_t kMostJobs = 30;

  ModelTest();

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
  /// Calls until there is an answer, and returns that.
  template <typename Call>
  auto Ask(const Call& call);
  void TakeUpStrays(Tenant& tenant, const v1::CreateJobRequest& request,
                    std::optional<int> kind, const std::string& answered);
  v1::ListJobsResponse Page(const Tenant& tenant,
                            const v1::ListJobsRequest& request);
  std::vector<v1::Job> RestOf(const Tenant& tenant,
                              v1::ListJobsRequest request);
  void Refresh(Tenant& tenant, const std::string& name);
  void CheckAll();

  Restarts restarts() const { return server_->restarts(); }
  void Expect(bool holds, const std::string& what) {
    EXPECT_TRUE(holds) << "ISOMATCH_SEED=" << seed_ << ", step " << step_
                       << ": " << what;
  }
  void ExpectNone(const std::string& problem) {
    Expect(problem.empty(), problem);
  }
  const TemporaryFolder folder_;
  const std::uint64_t seed_ = PrintedSeed();
  const KnownJobs known_{kKinds};
  RandomRequests random_{seed_, &known_};
  std::unique_ptr<ModelServer> server_;
  std::vector<Tenant> tenants_;
  int step_ = 0;
  int jobs_ = 0;
  /// Whether the last Ask called more than once.
  bool was_repeated_ = false;
  int repeated_ = 0;
  int strays_ = 0;
};

ModelTest::ModelTest() {
  std::string keys;
  for (const char* name : {"one", "two"}) {
    absl::StrAppend(&keys, name, " ", name, " submit ",
                    Sha256Hex(absl::StrCat("key of ", name)), "\n");
  }
  const std::vector<std::string> flags = {
      "--api-keys",      folder_.Write("keys.txt", keys),
      "--drain-timeout", "100ms",
      "--max-kept-jobs", "1000000"};
  if (GetParam() == ServerKind::kOne) {
    server_ = std::make_unique<OneModelServer>(flags);
  } else {
    server_ = std::make_unique<ClusterModelServer>(flags);
  }
  for (const char* name : {"one", "two"}) {
    tenants_.push_back({absl::StrCat("key of ", name),
                        JobModel(name, &known_, server_->rules())});
  }
}

template <typename Call>
auto ModelTest::Ask(const Call& call) {
  const absl::Time end = absl::Now() + absl::Minutes(1);
  was_repeated_ = false;
  while (true) {
    auto answer = call(server_->stub(random_.Any()));
    const absl::Status status = StatusOf(answer);
    // gRPC cancels what it has not begun when a server shuts down.
    const bool is_away =
        absl::IsUnavailable(status) || absl::IsCancelled(status);
    if (!server_->may_be_away() || !is_away || absl::Now() > end) return answer;
    was_repeated_ = true;
    ++repeated_;
    absl::SleepFor(absl::Milliseconds(20));
  }
}

void ModelTest::Restart() {
  // Lists stay open while the newest jobs go, and others come later.
  for (Tenant& tenant : tenants_) {
    if (!tenant.list) TurnPage(tenant);
    for (int i = random_.Below(4); i > 0 && !tenant.model.jobs().empty(); --i) {
      Delete(tenant, tenant.model.jobs().rbegin()->second);
    }
  }
  server_->Restart(random_.Any());
  CheckAll();
}

void ModelTest::CheckAll() {
  for (Tenant& tenant : tenants_) {
    const v1::ListJobsRequest all;
    ExpectNone(tenant.model.CompareList(all, std::numeric_limits<int>::max(),
                                        RestOf(tenant, all), restarts()));
  }
}

void ModelTest::Create(Tenant& tenant) {
  if (tenant.model.jobs().size() >= kMostJobs) return Delete(tenant);
  auto [request, kind] = random_.Job(tenant.free_request_ids);
  const std::string sha256_x = Sha256Hex(request.mesh_x().draco());
  const std::string sha256_y = Sha256Hex(request.mesh_y().draco());
  auto has_x = JobModel::Presence::kThere;
  if (random_.OneIn(5)) {
    v1::Digest digest;
    digest.set_sha256(sha256_x);
    digest.set_size_bytes(request.mesh_x().draco().size());
    *request.mutable_mesh_x()->mutable_digest() = digest;
    has_x = tenant.model.PresenceOf(sha256_x);
  }
  const auto job =
      Ask([&](Stub& stub) { return CreateJob(stub, request, tenant.key); });
  const bool was_repeated = was_repeated_;
  const bool may_miss = has_x == JobModel::Presence::kMaybe && !job.ok();
  if (has_x == JobModel::Presence::kMissing || may_miss) {
    return Expect(ReasonOf(job.status()) == "MESH_MISSING",
                  job.status().ToString());
  }
  Expect(job.ok(), job.status().ToString());
  if (!job.ok()) return;
  if (request.validate_only()) return Expect(job->name().empty(), "validated");
  tenant.model.AddMesh(sha256_x);
  tenant.model.AddMesh(sha256_y);
  if (was_repeated && request.request_id().empty()) {
    TakeUpStrays(tenant, request, kind, job->name());
  }
  ExpectNone(tenant.model.Add(request, kind, ++jobs_, *job));
  ExpectNone(tenant.model.Observe(*job, restarts()));
}

/// Takes up the jobs that calls without an answer have made, the oldest first.
void ModelTest::TakeUpStrays(Tenant& tenant,
                             const v1::CreateJobRequest& request,
                             std::optional<int> kind,
                             const std::string& answered) {
  // What was on its way has arrived by then.
  absl::SleepFor(absl::Milliseconds(200));
  std::vector<v1::Job> jobs = RestOf(tenant, v1::ListJobsRequest());
  std::ranges::reverse(jobs);
  for (const v1::Job& job : jobs) {
    if (job.name() == answered || tenant.model.Find(job.name()) != nullptr) {
      continue;
    }
    ++strays_;
    ExpectNone(tenant.model.Add(request, kind, ++jobs_, job));
    ExpectNone(tenant.model.Observe(job, restarts()));
  }
}

void ModelTest::CreateAgain(Tenant& tenant) {
  const ModelJob* const job = tenant.model.Pick(random_.Any());
  if (job == nullptr || job->request.request_id().empty()) return;
  v1::CreateJobRequest request = job->request;
  if (random_.OneIn(3)) {
    request.set_priority(request.priority() + 1);
    const auto other =
        Ask([&](Stub& stub) { return CreateJob(stub, request, tenant.key); });
    return Expect(ReasonOf(other.status()) == "REQUEST_ID_REUSED",
                  other.status().ToString());
  }
  const std::string name = job->last.name();
  const auto same =
      Ask([&](Stub& stub) { return CreateJob(stub, request, tenant.key); });
  Expect(same.ok() && same->name() == name, same.status().ToString());
  if (same.ok()) ExpectNone(tenant.model.Observe(*same, restarts()));
}

void ModelTest::Refresh(Tenant& tenant, const std::string& name) {
  const auto job =
      Ask([&](Stub& stub) { return GetJob(stub, name, tenant.key); });
  Expect(job.ok(), job.status().ToString());
  if (job.ok()) ExpectNone(tenant.model.Observe(*job, restarts()));
}

void ModelTest::Get(Tenant& tenant) {
  Tenant& owner = tenants_[static_cast<size_t>(random_.Below(2))];
  const ModelJob* const job = owner.model.Pick(random_.Any());
  if (job == nullptr) return;
  if (&owner == &tenant) return Refresh(tenant, job->last.name());
  const auto found = Ask(
      [&](Stub& stub) { return GetJob(stub, job->last.name(), tenant.key); });
  Expect(ReasonOf(found.status()) == "JOB_NOT_FOUND", "another tenant's");
}

v1::ListJobsResponse ModelTest::Page(const Tenant& tenant,
                                     const v1::ListJobsRequest& request) {
  v1::ListJobsResponse page;
  const absl::Status status = Ask([&](Stub& stub) {
    CallContext context(tenant.key);
    return OutcomeOfCall(stub.ListJobs(&context, request, &page));
  });
  Expect(status.ok(), status.ToString());
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
  const v1::ListJobsRequest request = random_.Filter();
  ExpectNone(tenant.model.CompareList(request, std::numeric_limits<int>::max(),
                                      RestOf(tenant, request), restarts()));
}

/// Opens a list, or goes on with one of some operations ago: since then jobs
/// may have gone and others come, and the server may be another process.
void ModelTest::TurnPage(Tenant& tenant) {
  if (tenant.list) {
    const OpenList list = *std::exchange(tenant.list, std::nullopt);
    return ExpectNone(tenant.model.CompareList(
        list.next, list.before, RestOf(tenant, list.next), restarts()));
  }
  v1::ListJobsRequest request = random_.Filter();
  request.set_page_size(static_cast<std::uint32_t>(1 + random_.Below(4)));
  const v1::ListJobsResponse page = Page(tenant, request);
  if (page.next_page_token().empty()) return;
  request.set_page_token(page.next_page_token());
  const std::string& last = page.jobs(page.jobs_size() - 1).name();
  const ModelJob* const job = tenant.model.Find(last);
  Expect(job != nullptr, "unknown: " + last);
  if (job != nullptr) tenant.list = OpenList{request, job->number};
}

void ModelTest::Cancel(Tenant& tenant) {
  ModelJob* const job = tenant.model.Pick(random_.Any());
  if (job == nullptr) return;
  const std::string name = job->last.name();
  const bool was_terminal = IsEnd(job->last.state());
  if (!was_terminal) job->cancel_asked = true;
  const auto cancelled =
      Ask([&](Stub& stub) { return CancelJob(stub, name, tenant.key); });
  if (cancelled.ok()) {
    Expect(!was_terminal && cancelled->state() == v1::Job::STATE_CANCELLED,
           "cancelled: " + cancelled->ShortDebugString());
    return ExpectNone(tenant.model.Observe(*cancelled, restarts()));
  }
  Expect(ReasonOf(cancelled.status()) == "JOB_TERMINAL",
         cancelled.status().ToString());
  if (!was_terminal && !was_repeated_) job->cancel_asked = false;
  Refresh(tenant, name);
  Expect(IsEnd(job->last.state()), name + " is said to be terminal");
}

void ModelTest::Delete(Tenant& tenant) {
  const ModelJob* const job = tenant.model.Pick(random_.Any());
  if (job != nullptr) Delete(tenant, *job);
}

void ModelTest::Delete(Tenant& tenant, const ModelJob& job) {
  const std::string name = job.last.name();
  const absl::Status deleted =
      Ask([&](Stub& stub) { return DeleteJob(stub, name, tenant.key); });
  const bool is_gone = was_repeated_ && ReasonOf(deleted) == "JOB_NOT_FOUND";
  if (!deleted.ok() && !is_gone) {
    Expect(!IsEnd(job.last.state()) && ReasonOf(deleted) == "JOB_NOT_TERMINAL",
           deleted.ToString());
    return Refresh(tenant, name);
  }
  if (!job.request.request_id().empty()) {
    tenant.free_request_ids.push_back(job.request.request_id());
  }
  tenant.model.Remove(name);
  const auto found =
      Ask([&](Stub& stub) { return GetJob(stub, name, tenant.key); });
  Expect(ReasonOf(found.status()) == "JOB_NOT_FOUND", name + " is deleted");
}

void ModelTest::DownloadPart(Tenant& tenant) {
  const ModelJob* const job = tenant.model.Pick(random_.Any());
  if (job == nullptr || !job->kind) return;
  const auto part = static_cast<v1::ResultPart>(1 + random_.Below(5));
  const auto& parts = known_.parts(*job->kind);
  const auto expected = parts.find(part);
  const int size =
      expected == parts.end() ? 0 : static_cast<int>(expected->second.size());
  const auto offset = static_cast<std::uint64_t>(random_.Below(size + 2));
  const auto bytes = Ask([&](Stub& stub) {
    return Download(stub, job->last.name(), part, offset, tenant.key);
  });
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
  const ModelJob* const job = tenant.model.Pick(random_.Any());
  if (job == nullptr) return;
  const auto end = Ask([&](Stub& stub) {
    return WaitForEnd(stub, job->last.name(), tenant.key);
  });
  Expect(end.ok() && IsEnd(end->state()), end.status().ToString());
  if (end.ok()) ExpectNone(tenant.model.Observe(*end, restarts()));
}

void ModelTest::FindMissing(Tenant& tenant) {
  v1::FindMissingMeshesRequest request;
  for (int i = 0; i < 5; ++i) {
    const std::string& mesh = random_.Mesh();
    v1::Digest& digest = *request.add_digests();
    digest.set_sha256(Sha256Hex(mesh));
    digest.set_size_bytes(mesh.size());
  }
  v1::FindMissingMeshesResponse response;
  const absl::Status status = Ask([&](Stub& stub) {
    CallContext context(tenant.key);
    return OutcomeOfCall(stub.FindMissingMeshes(&context, request, &response));
  });
  Expect(status.ok(), status.ToString());
  std::set<std::string> missing;
  for (const v1::Digest& digest : response.missing()) {
    missing.insert(digest.sha256());
  }
  for (const v1::Digest& digest : request.digests()) {
    const auto presence = tenant.model.PresenceOf(digest.sha256());
    if (presence == JobModel::Presence::kMaybe) continue;
    const bool is_missing = missing.count(digest.sha256()) > 0;
    Expect(is_missing == (presence == JobModel::Presence::kMissing),
           "missing or not: " + digest.sha256());
  }
}

void ModelTest::Upload(Tenant& tenant) {
  const std::string& mesh = random_.Mesh();
  const std::string sha256 = Sha256Hex(mesh);
  v1::UploadMeshResponse response;
  const absl::Status status = Ask([&](Stub& stub) {
    CallContext context(tenant.key);
    const auto writer = stub.UploadMesh(&context, &response);
    v1::UploadMeshRequest message;
    message.mutable_header()->set_sha256(sha256);
    message.mutable_header()->set_size_bytes(mesh.size());
    writer->Write(message);
    message.set_chunk(mesh);
    writer->Write(message);
    writer->WritesDone();
    return OutcomeOfCall(writer->Finish());
  });
  Expect(status.ok(), status.ToString());
  const auto presence = tenant.model.PresenceOf(sha256);
  tenant.model.AddMesh(sha256);
  const bool was_there = presence == JobModel::Presence::kThere;
  const bool may_be_known =
      was_repeated_ || presence == JobModel::Presence::kMaybe;
  Expect(response.known() == was_there || may_be_known, "known");
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
  int at = random_.Below(kWeights);
  for (const auto& [weight, operation] : kOperations) {
    at -= weight;
    if (at >= 0) continue;
    return (this->*operation)(tenants_[static_cast<size_t>(random_.Below(2))]);
  }
}

TEST_P(ModelTest, ServerAndModelAgreeAfterEachOperation) {
  ASSERT_FALSE(HasFailure()) << "no server";
  const bool is_one = GetParam() == ServerKind::kOne;
  const std::string name = is_one ? "model: " : "model of the cluster: ";
  const int operations =
      Rounds("ISOMATCH_OPERATIONS", is_one ? 5000 : 1000, 200'000);
  const int per_restart =
      Rounds("ISOMATCH_OPERATIONS_PER_RESTART", is_one ? 250 : 50, 500);
  for (step_ = 0; step_ < operations && !HasFailure(); ++step_) {
    if (random_.OneIn(per_restart)) Restart();
    Step();
    if (step_ % 50 == 0) CheckAll();
  }
  PrintFigure(name + "operations", step_, "");
  PrintFigure(name + "jobs", jobs_, "");
  PrintFigure(name + "restarts", restarts().begun, "");
  if (!is_one) {
    PrintFigure(name + "calls without an answer", repeated_, "");
    PrintFigure(name + "jobs found that they made", strays_, "");
  }
  ExpectAtMost(name + "disagreements", HasFailure() ? 1 : 0, 0, "");
}

std::string NameOfServer(const testing::TestParamInfo<ServerKind>& server) {
  return server.param == ServerKind::kOne ? "OneServer" : "Cluster";
}

INSTANTIATE_TEST_SUITE_P(Servers, ModelTest,
                         testing::Values(ServerKind::kOne,
                                         ServerKind::kCluster),
                         NameOfServer);

}  // namespace
}  // namespace isomatch
