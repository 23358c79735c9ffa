#include "tests/soak/known_jobs.h"

#include <atomic>
#include <utility>

#include <gtest/gtest.h>
#include <unistd.h>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/sha256.h"
#include "tests/server/test_server.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

TriangleMesh MakeMesh(int kind) {
  if (kind % 3 == 0) return Tetrahedron();
  if (kind % 3 == 1) return UnitSphere(/*levels=*/0);
  return PlaneGrid(/*columns=*/3, /*rows=*/3, /*width=*/1, /*height=*/1.3);
}

v1::CreateJobRequest MakeRequest(int kind) {
  const TriangleMesh mesh = MakeMesh(kind);
  const auto seed = static_cast<std::uint64_t>(kind);
  v1::CreateJobRequest request;
  *request.mutable_mesh_x() = ToDraco(mesh);
  *request.mutable_mesh_y() =
      ToDraco(Relabeled(mesh, RandomPermutation(mesh.num_vertices(), seed)));
  // The quicker one for each.
  request.mutable_options()->set_profile(kind % 3 == 0 ? v1::PROFILE_DEFAULT
                                                       : v1::PROFILE_PAPER);
  request.mutable_options()->set_random_seed(seed);
  request.mutable_options()->set_functional_map(kind % 2 == 0);
  return request;
}

}  // namespace

KnownJobs::KnownJobs(int count) {
  SoakServer server;
  for (int kind = 0; kind < count; ++kind) {
    requests_.push_back(MakeRequest(kind));
    const auto created = CreateJob(server.stub(), requests_.back());
    EXPECT_TRUE(created.ok()) << created.status();
    const auto job = WaitForEnd(server.stub(), created->name());
    EXPECT_TRUE(job.ok() && job->state() == v1::Job::STATE_SUCCEEDED)
        << job->DebugString();
    Parts parts;
    for (const v1::ResultPartInfo& info : job->result().parts()) {
      parts[info.part()] =
          *Download(server.stub(), created->name(), info.part());
    }
    parts_.push_back(std::move(parts));
  }
}

std::string KnownJobs::ProblemOf(int kind, const v1::Job& job) const {
  const Parts& expected = parts(kind);
  if (job.result().parts_size() != static_cast<int>(expected.size())) {
    return absl::StrCat(job.name(), " has ", job.result().parts_size(),
                        " parts, expected ", expected.size());
  }
  for (const v1::ResultPartInfo& info : job.result().parts()) {
    const auto found = expected.find(info.part());
    if (found == expected.end() ||
        Sha256Hex(found->second) != info.digest().sha256()) {
      return absl::StrCat(job.name(), " is of other content in its part ",
                          info.part());
    }
  }
  return "";
}

std::string KnownJobs::ProblemOfDownload(int kind, Stub& stub,
                                         const std::string& name,
                                         const std::string& key) const {
  for (const auto& [part, expected] : parts(kind)) {
    const auto bytes = Download(stub, name, part, /*offset=*/0, key);
    if (!bytes.ok()) return absl::StrCat(name, ": ", bytes.status().ToString());
    if (*bytes != expected) {
      return absl::StrCat(name, " brings other bytes of its part ", part);
    }
  }
  return "";
}

v1::CreateJobRequest LongJob() {
  v1::CreateJobRequest request;
  *request.mutable_mesh_x() = ToDraco(BumpySphere(/*levels=*/5));
  *request.mutable_mesh_y() = request.mesh_x();
  request.mutable_options()->set_profile(v1::PROFILE_PAPER);
  return request;
}

std::string UniqueRequestId() {
  static std::atomic<int> count = 0;
  return absl::StrCat(getpid(), "-", absl::ToUnixNanos(absl::Now()), "-",
                      ++count);
}

}  // namespace isomatch
