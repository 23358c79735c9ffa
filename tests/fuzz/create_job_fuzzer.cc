// Any request ends in an error that names a reason and a field, or in a job
// whose every part is in range. The input is a CreateJobRequest as it comes
// over the network.

#include <cstddef>
#include <cstdint>
#include <set>
#include <string>

#include "absl/time/clock.h"
#include "core/base/sha256.h"
#include "core/io/draco_mesh.h"
#include "server/convert/parse_create_job.h"
#include "server/convert/result_info.h"
#include "server/convert/stored_request.h"
#include "server/jobs/errors.h"
#include "server/storage/memory_blob_store.h"
#include "tests/fuzz/check.h"

namespace isomatch {
namespace {

constexpr char kTenant[] = "default";

/// One mesh is there, of the bytes that the corpus names by their digest.
class FuzzedService {
 public:
  FuzzedService()
      : runner_(CoreMatchEngine(), DescribeResult, absl::Now, no_cache_) {
    TriangleMesh tetrahedron;
    tetrahedron.positions.resize(4, 3);
    tetrahedron.positions << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1;
    tetrahedron.faces.resize(4, 3);
    tetrahedron.faces << 0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3;
    const std::string bytes = EncodeDraco(tetrahedron)->bytes;
    ISOMATCH_CHECK(
        blobs_.Put({kTenant, Sha256Hex(bytes)}, bytes, Keep::kPinned).ok());
    context_ = {&blobs_, &runner_, Limits(), /*threads_per_job=*/4};
  }

  const ParseContext& context() const { return context_; }

 private:
  static RequestLimits Limits() {
    RequestLimits limits;
    limits.max_landmarks = 8;
    limits.draco.max_vertices = 10'000;
    limits.draco.max_faces = 20'000;
    limits.draco.max_attribute_bytes = 1 << 20;
    return limits;
  }

  MemoryBlobStore blobs_{1 << 20};
  PreparedCache no_cache_{0, nullptr};
  JobRunner runner_;
  ParseContext context_;
};

void CheckMesh(const TriangleMesh& mesh) {
  ISOMATCH_CHECK(ValidateMesh(mesh, "mesh").ok());
}

void CheckJob(const JobSpec& spec, const RequestLimits& limits) {
  CheckMesh(spec.mesh_x);
  CheckMesh(spec.mesh_y);
  ISOMATCH_CHECK(spec.landmarks.size() <=
                 static_cast<std::size_t>(limits.max_landmarks));
  for (const Landmark& landmark : spec.landmarks) {
    ISOMATCH_CHECK(landmark.x >= 0 && landmark.y >= 0);
    ISOMATCH_CHECK(landmark.x < spec.mesh_x.num_vertices());
    ISOMATCH_CHECK(landmark.y < spec.mesh_y.num_vertices());
  }
  ISOMATCH_CHECK(spec.options.Validate().ok());
  ISOMATCH_CHECK(spec.options.threads >= 1 && spec.options.threads <= 4);
  ISOMATCH_CHECK(spec.priority >= -100 && spec.priority <= 100);
  ISOMATCH_CHECK(spec.labels.size() <= RequestLimits::kMaxLabels);
  for (const auto& timeout : {spec.queue_timeout, spec.run_timeout}) {
    ISOMATCH_CHECK(!timeout || (*timeout > absl::ZeroDuration() &&
                                *timeout <= absl::Hours(30 * 24)));
  }
}

void CheckError(const absl::Status& status) {
  static const std::set<std::string> kReasons = {
      "INVALID_FIELD",      "MESH_MALFORMED",       "MESH_TOO_LARGE",
      "MATCH_OUT_OF_RANGE", "LANDMARKS_CONTRADICT", "MESH_MISSING"};
  const ErrorDetails details = DetailsOf(status);
  ISOMATCH_CHECK(kReasons.count(details.reason) == 1);
  ISOMATCH_CHECK(!details.field.empty());
}

}  // namespace
}  // namespace isomatch

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data,
                                      std::size_t size) {
  static const isomatch::FuzzedService service;
  isomatch::v1::CreateJobRequest request;
  if (!request.ParseFromArray(data, static_cast<int>(size))) return 0;
  const auto spec =
      isomatch::ParseCreateJob(request, service.context(), isomatch::kTenant);
  if (spec.ok()) {
    isomatch::CheckJob(*spec, service.context().limits);
  } else {
    isomatch::CheckError(spec.status());
  }
  ISOMATCH_CHECK(
      isomatch::RequestSha256(request) ==
      isomatch::RequestSha256(isomatch::v1::CreateJobRequest(request)));
  return 0;
}
