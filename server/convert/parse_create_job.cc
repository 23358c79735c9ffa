#include "server/convert/parse_create_job.h"

#include <algorithm>
#include <cstdint>
#include <future>
#include <iterator>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "absl/algorithm/container.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "core/base/status_macros.h"
#include "core/io/draco_mesh.h"
#include "core/mesh/mesh_geometry.h"
#include "core/mesh/mesh_size.h"
#include "server/convert/digest.h"
#include "server/convert/labels.h"
#include "server/jobs/errors.h"

namespace isomatch {
namespace {

absl::StatusOr<VertexOrder> ParseVertexOrder(v1::VertexOrder order,
                                             const std::string& field) {
  switch (order) {
    case v1::VERTEX_ORDER_UNSPECIFIED:
    case v1::VERTEX_ORDER_DECODED:
      return VertexOrder::kDecoded;
    case v1::VERTEX_ORDER_ID_ATTRIBUTE:
      return VertexOrder::kIdAttribute;
    default:
      return InvalidField(field,
                          absl::StrCat(order, ", expected a VertexOrder"));
  }
}

/// The bytes of a mesh: within the request, or from the store, which `held`
/// then keeps from being evicted.
struct FoundBytes {
  absl::string_view bytes;
  BlobStore::Blob held = nullptr;
};

/// The memory that reading a mesh may take, and what of it is taken.
struct ReadingRoom {
  std::int64_t held_bytes = 0;
  std::int64_t most_bytes;
};

absl::StatusOr<FoundBytes> FindBytes(const v1::Mesh& mesh,
                                     const std::string& field,
                                     const ParseContext& context,
                                     const std::string& tenant,
                                     const ReadingRoom& room) {
  if (mesh.has_draco()) return FoundBytes{mesh.draco()};
  if (!mesh.has_digest()) {
    return InvalidField(field, "no source, expected draco or digest");
  }
  const v1::Digest& digest = mesh.digest();
  const std::string path = field + ".digest";
  ISOMATCH_RETURN_IF_ERROR(ValidateDigest(digest, path, context.limits));
  const auto size = static_cast<std::int64_t>(digest.size_bytes());
  if (size > room.most_bytes - room.held_bytes) {
    return MeshesNeedMoreMemory(room.held_bytes + size, room.most_bytes);
  }
  auto blob = context.blobs->Get({tenant, digest.sha256()});
  if (absl::IsNotFound(blob.status())) {
    return MeshMissing(path, digest.sha256());
  }
  if (!blob.ok()) return ContentUnavailable(path, blob.status());
  const std::string& bytes = **blob;
  if (digest.size_bytes() != bytes.size()) {
    return InvalidField(
        path + ".size_bytes",
        absl::StrCat(digest.size_bytes(), ", expected ", bytes.size()));
  }
  return FoundBytes{bytes, *std::move(blob)};
}

absl::StatusOr<TriangleMesh> DecodeWithin(DracoLimits limits,
                                          absl::string_view bytes,
                                          VertexOrder order,
                                          std::uint32_t vertex_count,
                                          ReadingRoom room) {
  limits.reserve = [&room](std::int64_t more_bytes) {
    room.held_bytes += more_bytes;
    return room.held_bytes <= room.most_bytes
               ? absl::OkStatus()
               : MeshesNeedMoreMemory(room.held_bytes, room.most_bytes);
  };
  return DecodeDraco(bytes, order, vertex_count, limits);
}

/// A mesh of the request, and what is to be said of it.
struct ParsedMesh {
  TriangleMesh mesh;
  std::vector<std::string> warnings;
};

/// Adds a warning where the map would count vertices in an order that the
/// client may not know of.
void WarnOfDracosOrder(v1::VertexOrder order, const std::string& field,
                       absl::string_view bytes,
                       std::vector<std::string>& warnings) {
  if (order != v1::VERTEX_ORDER_UNSPECIFIED || !RenumbersVertices(bytes)) {
    return;
  }
  warnings.push_back(absl::StrCat(
      field,
      ": vertex_order is not set and the mesh is encoded by edgebreaker, which "
      "gives vertices other numbers: landmarks and map count them as Draco's "
      "decoder returns them, not as they were before they were encoded. Say "
      "VERTEX_ORDER_ID_ATTRIBUTE and send a vertex_id attribute, or encode "
      "sequentially; VERTEX_ORDER_DECODED says that this is meant"));
}

/// Adds a warning where single precision, in which Draco's coordinates come,
/// has rounded the mesh's shape, as far from the origin.
void WarnOfRounding(const std::string& field, ParsedMesh& parsed) {
  const std::optional<SingleRounding> rounding = CoarseRounding(parsed.mesh);
  if (!rounding) return;
  parsed.warnings.push_back(absl::StrFormat(
      "%s: coordinates of up to %.3g are rounded by %.3g in single precision, "
      "more than a hundredth of the mean edge (%.3g): subtract the mesh's "
      "middle before it is encoded",
      field, rounding->farthest, rounding->most, rounding->mean_edge));
}

/// Returns a mesh of the request, read within `room`.
absl::StatusOr<ParsedMesh> ParseMesh(const v1::Mesh& mesh,
                                     const std::string& field,
                                     const ParseContext& context,
                                     const std::string& tenant,
                                     ReadingRoom room) {
  ISOMATCH_ASSIGN_OR_RETURN(
      const VertexOrder order,
      ParseVertexOrder(mesh.vertex_order(), field + ".vertex_order"));
  const DracoLimits& limits = context.limits.draco;
  if (mesh.vertex_count() > limits.max_vertices) {
    return InvalidField(field + ".vertex_count",
                        absl::StrCat(mesh.vertex_count(), ", expected at most ",
                                     limits.max_vertices));
  }
  ISOMATCH_ASSIGN_OR_RETURN(const FoundBytes found,
                            FindBytes(mesh, field, context, tenant, room));
  const absl::string_view bytes = found.bytes;
  if (found.held) {
    room.held_bytes += static_cast<std::int64_t>(found.held->size());
  }
  ParsedMesh parsed;
  WarnOfDracosOrder(mesh.vertex_order(), field, bytes, parsed.warnings);
  auto decoded = DecodeWithin(limits, bytes, order, mesh.vertex_count(), room);
  if (IsNeedsMoreMemory(decoded.status())) return decoded.status();
  if (absl::IsResourceExhausted(decoded.status())) return OutOfMemory();
  if (!decoded.ok()) {
    return MeshMalformed(field + (found.held ? ".digest" : ".draco"),
                         std::string(decoded.status().message()));
  }
  parsed.mesh = *std::move(decoded);
  const absl::Status valid = ValidateMesh(parsed.mesh, field);
  if (!valid.ok()) {
    return MeshMalformed(LeadingFieldPath(valid.message(), field),
                         std::string(valid.message()));
  }
  WarnOfRounding(field, parsed);
  return parsed;
}

/// Reads both meshes of the request into `spec`: at the same time where jobs
/// may have two threads and half the room does for each mesh, else Y once X
/// takes no more than its mesh.
absl::Status ParseMeshes(const v1::CreateJobRequest& request,
                         const ParseContext& context, const std::string& tenant,
                         JobSpec& spec) {
  const auto parse_x = [&](const ReadingRoom& room) {
    return ParseMesh(request.mesh_x(), "mesh_x", context, tenant, room);
  };
  const auto parse_y = [&](const ReadingRoom& room) {
    return ParseMesh(request.mesh_y(), "mesh_y", context, tenant, room);
  };
  const std::int64_t most = context.limits.max_reading_bytes;
  absl::StatusOr<ParsedMesh> x;
  absl::StatusOr<ParsedMesh> y;
  const bool at_once = context.threads_per_job > 1;
  if (at_once) {
    const ReadingRoom half = {.most_bytes = most / 2};
    // Where there is no thread for it now, get() reads it.
    std::future<absl::StatusOr<ParsedMesh>> reading_y =
        std::async([&] { return parse_y(half); });
    x = parse_x(half);
    y = reading_y.get();
  }
  if (!at_once || IsNeedsMoreMemory(x.status()) ||
      IsNeedsMoreMemory(y.status())) {
    y = absl::StatusOr<ParsedMesh>();
    if (!x.ok()) x = parse_x({.most_bytes = most});
    ISOMATCH_RETURN_IF_ERROR(x.status());
    y = parse_y({static_cast<std::int64_t>(MeshBytes(SizeOf(x->mesh))), most});
  }
  ISOMATCH_RETURN_IF_ERROR(x.status());
  ISOMATCH_RETURN_IF_ERROR(y.status());
  spec.mesh_x = std::move(x->mesh);
  spec.mesh_y = std::move(y->mesh);
  absl::c_move(x->warnings, std::back_inserter(spec.warnings));
  absl::c_move(y->warnings, std::back_inserter(spec.warnings));
  return absl::OkStatus();
}

absl::Status CheckRange(std::int64_t vertex, std::int64_t vertices,
                        const std::string& field) {
  if (vertex < vertices) return absl::OkStatus();
  return MatchOutOfRange(field, vertex, vertices);
}

/// REQUIRES: the landmarks are in range.
absl::Status CheckLandmarksOnSurface(const JobSpec& spec) {
  if (spec.landmarks.empty()) return absl::OkStatus();
  const std::vector<bool> on_x = VerticesOnFaces(spec.mesh_x);
  const std::vector<bool> on_y = VerticesOnFaces(spec.mesh_y);
  for (size_t i = 0; i < spec.landmarks.size(); ++i) {
    const Landmark& landmark = spec.landmarks[i];
    const bool x_is_on = on_x[static_cast<size_t>(landmark.x)];
    if (x_is_on && on_y[static_cast<size_t>(landmark.y)]) continue;
    return InvalidField(
        absl::StrCat("landmarks[", i, x_is_on ? "].y" : "].x"),
        absl::StrCat("vertex ", x_is_on ? landmark.y : landmark.x,
                     " is on no face, expected one of the surface"));
  }
  return absl::OkStatus();
}

absl::Status ParseLandmarks(const v1::CreateJobRequest& request,
                            const ParseContext& context, JobSpec& spec) {
  if (request.landmarks_size() > context.limits.max_landmarks) {
    return InvalidField(
        "landmarks",
        absl::StrCat(request.landmarks_size(), " of them, expected at most ",
                     context.limits.max_landmarks));
  }
  for (int i = 0; i < request.landmarks_size(); ++i) {
    const v1::Landmark& landmark = request.landmarks(i);
    const std::string field = absl::StrCat("landmarks[", i, "]");
    ISOMATCH_RETURN_IF_ERROR(
        CheckRange(landmark.x(), spec.mesh_x.num_vertices(), field + ".x"));
    ISOMATCH_RETURN_IF_ERROR(
        CheckRange(landmark.y(), spec.mesh_y.num_vertices(), field + ".y"));
    spec.landmarks.push_back({static_cast<VertexIndex>(landmark.x()),
                              static_cast<VertexIndex>(landmark.y())});
  }
  const absl::Status valid = context.runner->ValidateLandmarks(spec);
  if (valid.ok()) return CheckLandmarksOnSurface(spec);
  return LandmarksContradict(LeadingFieldPath(valid.message(), "landmarks"),
                             std::string(valid.message()));
}

absl::Status ParseSolvedVertices(const v1::MatchOptions& proto,
                                 MatchOptions& options) {
  constexpr std::uint32_t kMost = std::numeric_limits<int>::max();
  if (!proto.has_solved_vertices()) return absl::OkStatus();
  options.solved_vertices =
      static_cast<int>(std::min(proto.solved_vertices(), kMost));
  if (options.Validate().ok()) return absl::OkStatus();
  return InvalidField("options.solved_vertices",
                      absl::StrCat(proto.solved_vertices(),
                                   ", expected 0 or 500 to 1000000000"));
}

constexpr char kMemoryLimit[] = "options.memory_limit_bytes";

absl::Status ParseMemoryLimit(const v1::MatchOptions& proto,
                              MatchOptions& options) {
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
  if (proto.memory_limit_bytes() > std::uint64_t{kMost}) {
    return InvalidField(kMemoryLimit, absl::StrCat(proto.memory_limit_bytes(),
                                                   ", expected 0 to ", kMost));
  }
  options.memory_limit_bytes =
      static_cast<std::int64_t>(proto.memory_limit_bytes());
  return absl::OkStatus();
}

/// An error of MatchOptions::Validate, "options.field: what", as one of a
/// field.
absl::Status InvalidOptions(const absl::Status& status) {
  if (status.ok()) return status;
  const std::pair<absl::string_view, absl::string_view> parts =
      absl::StrSplit(status.message(), absl::MaxSplits(": ", 1));
  return InvalidField(std::string(parts.first), std::string(parts.second));
}

/// Once the meshes are known.
absl::Status PlanMemory(const ParseContext& context, JobSpec& spec) {
  absl::Status planned = context.runner->PlanMemory(spec);
  if (planned.ok()) return planned;
  absl::string_view detail = planned.message();
  absl::ConsumePrefix(&detail, absl::StrCat(kMemoryLimit, ": "));
  return InvalidField(kMemoryLimit, std::string(detail));
}

absl::Status ParseRelation(const v1::MatchOptions& proto,
                           MatchOptions& options) {
  if (!v1::Relation_IsValid(proto.relation())) {
    return InvalidField(
        "options.relation",
        absl::StrCat(proto.relation(), ", expected a Relation"));
  }
  if (!v1::LengthScale_IsValid(proto.scale())) {
    return InvalidField(
        "options.scale",
        absl::StrCat(proto.scale(), ", expected a LengthScale"));
  }
  if (proto.relation() != v1::RELATION_UNSPECIFIED) {
    options.relation = static_cast<Relation>(proto.relation());
  }
  if (proto.scale() == v1::LENGTH_SCALE_SAME) {
    options.scale = LengthScale::kSame;
  }
  return InvalidOptions(options.Validate());
}

absl::Status ParseOptions(const v1::MatchOptions& proto, int threads_per_job,
                          JobSpec& spec) {
  if (!v1::Profile_IsValid(proto.profile())) {
    return InvalidField("options.profile",
                        absl::StrCat(proto.profile(), ", expected a Profile"));
  }
  if (proto.threads() > RequestLimits::kMaxThreads) {
    return InvalidField("options.threads",
                        absl::StrCat(proto.threads(), ", expected 0 to ",
                                     RequestLimits::kMaxThreads));
  }
  const bool paper = proto.profile() == v1::PROFILE_PAPER;
  spec.options =
      MatchOptions::ForProfile(paper ? Profile::kPaper : Profile::kDefault);
  spec.options.random_seed = proto.random_seed();
  spec.options.landmarks_exact = proto.landmarks_exact();
  spec.options.keep_functional_map = proto.functional_map();
  ISOMATCH_RETURN_IF_ERROR(ParseRelation(proto, spec.options));
  ISOMATCH_RETURN_IF_ERROR(ParseSolvedVertices(proto, spec.options));
  ISOMATCH_RETURN_IF_ERROR(ParseMemoryLimit(proto, spec.options));
  const int threads = static_cast<int>(proto.threads());
  spec.options.threads =
      threads == 0 ? threads_per_job : std::min(threads, threads_per_job);
  if (threads > threads_per_job) {
    spec.warnings.push_back(absl::StrCat("threads: ", threads,
                                         " were asked for, this server gives "
                                         "a job at most ",
                                         threads_per_job));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::optional<absl::Duration>> ParseTimeout(
    bool is_set, const google::protobuf::Duration& proto,
    const std::string& field) {
  constexpr std::int64_t kMaxSeconds = 30LL * 24 * 3600;
  constexpr int kNanos = 1'000'000'000;
  if (!is_set) return std::nullopt;
  const bool in_range = proto.seconds() >= 0 && proto.seconds() < kMaxSeconds &&
                        proto.nanos() >= 0 && proto.nanos() < kNanos;
  if (!in_range || (proto.seconds() == 0 && proto.nanos() == 0)) {
    return InvalidField(field, "expected more than 0 s and at most 30 days");
  }
  return absl::Seconds(proto.seconds()) + absl::Nanoseconds(proto.nanos());
}

absl::Status ParseScheduling(const v1::CreateJobRequest& request,
                             JobSpec& spec) {
  constexpr int kMost = RequestLimits::kMaxPriority;
  if (request.priority() < -kMost || request.priority() > kMost) {
    return InvalidField(
        "priority",
        absl::StrCat(request.priority(), ", expected ", -kMost, " to ", kMost));
  }
  if (!v1::DisconnectPolicy_IsValid(request.disconnect_policy())) {
    return InvalidField("disconnect_policy",
                        absl::StrCat(request.disconnect_policy(),
                                     ", expected a DisconnectPolicy"));
  }
  spec.priority = request.priority();
  spec.cancel_when_unwatched =
      request.disconnect_policy() == v1::DISCONNECT_POLICY_CANCEL;
  return absl::OkStatus();
}

/// Everything that can be checked without decoding.
absl::Status ParseScalars(const v1::CreateJobRequest& request,
                          const ParseContext& context, JobSpec& spec) {
  if (request.request_id().size() > RequestLimits::kMaxRequestIdBytes) {
    return InvalidField(
        "request_id",
        absl::StrCat(request.request_id().size(), " bytes, expected at most ",
                     RequestLimits::kMaxRequestIdBytes));
  }
  spec.request_id = request.request_id();
  spec.validate_only = request.validate_only();
  ISOMATCH_ASSIGN_OR_RETURN(spec.labels,
                            ParseLabels(request.labels(), "labels"));
  ISOMATCH_RETURN_IF_ERROR(ParseScheduling(request, spec));
  ISOMATCH_RETURN_IF_ERROR(ParseOptions(request.options(),
                                        context.threads_elsewhere
                                            ? context.threads_elsewhere()
                                            : context.threads_per_job,
                                        spec));
  ISOMATCH_ASSIGN_OR_RETURN(
      spec.queue_timeout,
      ParseTimeout(request.has_queue_timeout(), request.queue_timeout(),
                   "queue_timeout"));
  ISOMATCH_ASSIGN_OR_RETURN(spec.run_timeout,
                            ParseTimeout(request.has_run_timeout(),
                                         request.run_timeout(), "run_timeout"));
  ISOMATCH_ASSIGN_OR_RETURN(
      spec.deadline,
      ParseTimeout(request.has_deadline(), request.deadline(), "deadline"));
  if (spec.deadline && spec.options.profile == Profile::kPaper) {
    return InvalidField("deadline",
                        "set beside profile paper, expected the default one: "
                        "it alone has maps before the last");
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<JobSpec> ParseCreateJob(const v1::CreateJobRequest& request,
                                       const ParseContext& context,
                                       const std::string& tenant) {
  JobSpec spec;
  ISOMATCH_RETURN_IF_ERROR(ParseScalars(request, context, spec));
  ISOMATCH_RETURN_IF_ERROR(ParseMeshes(request, context, tenant, spec));
  ISOMATCH_RETURN_IF_ERROR(ParseLandmarks(request, context, spec));
  ISOMATCH_RETURN_IF_ERROR(PlanMemory(context, spec));
  return spec;
}

}  // namespace isomatch
