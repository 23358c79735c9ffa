#include "client/isomatch_client.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include <grpcpp/client_context.h>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "client/call_retry.h"
#include "client/rpc_status.h"
#include "core/base/status_macros.h"
#include "server/storage/sha256.h"

namespace isomatch {
namespace {

// Room in a request for all but the meshes, landmarks counted apart.
constexpr std::uint64_t kRequestOverheadBytes = 4096;
// A landmark with its tag, at most.
constexpr std::uint64_t kLandmarkBytes = 16;

constexpr std::uint64_t kDefaultChunkBytes = 64 << 10;

// What a server gets to answer for the first time: the address may be wrong.
constexpr absl::Duration kFirstContact = absl::Seconds(3);

// What telling the server to cancel may take.
constexpr absl::Duration kCancelTimeout = absl::Seconds(3);

bool IsTerminal(const v1::Job& job) {
  return job.state() == v1::Job::STATE_SUCCEEDED ||
         job.state() == v1::Job::STATE_FAILED ||
         job.state() == v1::Job::STATE_CANCELLED;
}

// OK for a job that succeeded, else why it did not.
absl::Status Outcome(const v1::Job& job) {
  if (job.state() == v1::Job::STATE_SUCCEEDED) return absl::OkStatus();
  if (job.state() == v1::Job::STATE_CANCELLED) {
    return absl::CancelledError("the job was cancelled on the server");
  }
  return absl::Status(
      static_cast<absl::StatusCode>(job.error().code()),
      absl::StrCat(job.error().message(), " (", job.error().reason(), ")"));
}

// A job the server does not know any more is not the user's mistake.
absl::Status JobLost(const absl::Status& status) {
  if (status.code() != absl::StatusCode::kNotFound) return status;
  return absl::InternalError(
      absl::StrCat("the server has forgotten the job: ", status.message()));
}

v1::Digest DigestOf(const std::string& bytes) {
  v1::Digest digest;
  digest.set_sha256(Sha256Hex(bytes));
  digest.set_size_bytes(bytes.size());
  return digest;
}

void SetMesh(const EncodedMesh& encoded, VertexIndex vertices, bool is_inline,
             v1::Mesh* mesh) {
  if (is_inline) {
    mesh->set_draco(encoded.bytes);
  } else {
    *mesh->mutable_digest() = DigestOf(encoded.bytes);
  }
  mesh->set_vertex_order(encoded.vertex_order == VertexOrder::kIdAttribute
                             ? v1::VERTEX_ORDER_ID_ATTRIBUTE
                             : v1::VERTEX_ORDER_DECODED);
  mesh->set_vertex_count(static_cast<std::uint32_t>(vertices));
}

bool Wants(const MatchRequest& request, v1::ResultPart part) {
  return std::find(request.parts.begin(), request.parts.end(), part) !=
         request.parts.end();
}

v1::CreateJobRequest MakeRequest(
    const MatchRequest& request,
    const std::pair<EncodedMesh, EncodedMesh>& meshes, bool is_inline) {
  v1::CreateJobRequest message;
  SetMesh(meshes.first, request.mesh_x.num_vertices(), is_inline,
          message.mutable_mesh_x());
  SetMesh(meshes.second, request.mesh_y.num_vertices(), is_inline,
          message.mutable_mesh_y());
  for (const VertexMatch& landmark : request.landmarks) {
    v1::Landmark* added = message.add_landmarks();
    added->set_x(static_cast<std::uint32_t>(landmark.x));
    added->set_y(static_cast<std::uint32_t>(landmark.y));
  }
  v1::MatchOptions& options = *message.mutable_options();
  options.set_profile(request.profile);
  options.set_random_seed(request.random_seed);
  options.set_threads(request.threads);
  options.set_landmarks_exact(request.landmarks_exact);
  options.set_functional_map(Wants(request, v1::RESULT_PART_FUNCTIONAL_MAP));
  if (request.solved_vertices) {
    options.set_solved_vertices(*request.solved_vertices);
  }
  message.set_priority(request.priority);
  // Nobody else knows the job's name.
  message.set_disconnect_policy(v1::DISCONNECT_POLICY_CANCEL);
  message.set_request_id(RandomUuid());
  return message;
}

bool FitsOneRequest(const std::pair<EncodedMesh, EncodedMesh>& meshes,
                    const MatchRequest& request, std::uint64_t limit) {
  return meshes.first.bytes.size() + meshes.second.bytes.size() +
             request.landmarks.size() * kLandmarkBytes +
             kRequestOverheadBytes <=
         limit;
}

// The digest of a part; null when the result has none of that kind.
const v1::Digest* FindDigest(const v1::ResultInfo& info, v1::ResultPart part) {
  // Servers before the parts came have the map only.
  if (part == v1::RESULT_PART_MAP) return &info.digest();
  for (const v1::ResultPartInfo& candidate : info.parts()) {
    if (candidate.part() == part) return &candidate.digest();
  }
  return nullptr;
}

absl::Status CheckDigest(const std::string& bytes, const v1::Digest& digest) {
  if (bytes.size() == digest.size_bytes() &&
      Sha256Hex(bytes) == digest.sha256()) {
    return absl::OkStatus();
  }
  return absl::DataLossError(absl::StrCat(
      "the result arrived damaged: ", bytes.size(), " bytes, expected ",
      digest.size_bytes(), " with SHA-256 ", digest.sha256()));
}

absl::Status SetPart(v1::ResultPart part, const std::string& bytes,
                     PairSize size, MatchResult& result) {
  switch (part) {
    case v1::RESULT_PART_MAP: {
      ISOMATCH_ASSIGN_OR_RETURN(result.y_from_x, DecodeMap(bytes, size));
      break;
    }
    case v1::RESULT_PART_PRECISE_MAP: {
      ISOMATCH_ASSIGN_OR_RETURN(result.precise, DecodePreciseMap(bytes, size));
      break;
    }
    case v1::RESULT_PART_CONFIDENCE: {
      ISOMATCH_ASSIGN_OR_RETURN(result.confidence,
                                DecodeConfidence(bytes, size));
      break;
    }
    case v1::RESULT_PART_ALTERNATIVE_MAP: {
      ISOMATCH_ASSIGN_OR_RETURN(result.alternative, DecodeMap(bytes, size));
      break;
    }
    case v1::RESULT_PART_FUNCTIONAL_MAP: {
      ISOMATCH_ASSIGN_OR_RETURN(result.functional_map,
                                DecodeFunctionalMap(bytes));
      break;
    }
    default:
      return absl::InvalidArgumentError(
          absl::StrCat("part ", part, ", expected a ResultPart"));
  }
  return absl::OkStatus();
}

}  // namespace

IsomatchClient::IsomatchClient(const std::shared_ptr<grpc::Channel>& channel)
    : stub_(v1::CorrespondenceService::NewStub(channel)) {}

absl::StatusOr<v1::GetServerInfoResponse> IsomatchClient::GetServerInfo(
    const std::stop_token& stop) {
  const auto deadline = absl::ToChronoTime(absl::Now() + kFirstContact);
  v1::GetServerInfoResponse response;
  const absl::Status status = Retry(
      stop,
      [&](grpc::ClientContext* context) {
        context->set_deadline(deadline);
        return stub_->GetServerInfo(context, {}, &response);
      },
      kFirstContact);
  if (status.ok()) return response;
  if (status.code() != absl::StatusCode::kUnavailable &&
      status.code() != absl::StatusCode::kDeadlineExceeded) {
    return status;
  }
  return absl::UnavailableError(
      absl::StrCat("no answer within ", absl::FormatDuration(kFirstContact),
                   ", expected a running isomatch-server: ", status.message()));
}

absl::StatusOr<MatchResult> IsomatchClient::Match(const MatchRequest& request,
                                                  const JobCallback& on_change,
                                                  const std::stop_token& stop) {
  ISOMATCH_ASSIGN_OR_RETURN(const v1::GetServerInfoResponse server,
                            GetServerInfo(stop));
  ISOMATCH_ASSIGN_OR_RETURN(EncodedMesh x, EncodeDraco(request.mesh_x));
  ISOMATCH_ASSIGN_OR_RETURN(EncodedMesh y, EncodeDraco(request.mesh_y));
  const Encoded meshes(std::move(x), std::move(y));
  const bool is_inline =
      FitsOneRequest(meshes, request, server.limits().max_request_bytes());
  if (!is_inline) {
    ISOMATCH_RETURN_IF_ERROR(
        UploadMissing(meshes, server.limits().max_chunk_bytes(), stop));
  }
  ISOMATCH_ASSIGN_OR_RETURN(
      const v1::Job created,
      CreateJob(MakeRequest(request, meshes, is_inline), stop));
  ISOMATCH_ASSIGN_OR_RETURN(const v1::Job job,
                            WatchToEnd(created, on_change, stop));
  ISOMATCH_RETURN_IF_ERROR(Outcome(job));
  return Fetch(request, job, stop);
}

absl::Status IsomatchClient::UploadMissing(const Encoded& meshes,
                                           std::uint64_t chunk_bytes,
                                           const std::stop_token& stop) {
  for (const EncodedMesh* mesh : {&meshes.first, &meshes.second}) {
    ISOMATCH_RETURN_IF_ERROR(Upload(mesh->bytes, chunk_bytes, stop));
  }
  return absl::OkStatus();
}

absl::Status IsomatchClient::Upload(const std::string& bytes,
                                    std::uint64_t chunk_bytes,
                                    const std::stop_token& stop) {
  const v1::Digest digest = DigestOf(bytes);
  Backoff backoff(stop);
  std::uint64_t offset = 0;
  absl::Status status;
  do {
    ISOMATCH_ASSIGN_OR_RETURN(const std::optional<std::uint64_t> received,
                              FindReceived(digest, stop));
    if (!received) return absl::OkStatus();
    if (*received > offset) backoff.Reset();
    offset = *received;
    status = SendFrom(offset, bytes, digest, chunk_bytes, stop);
    // An idle upload goes on. What the server has may have expired since, or be
    // another's damage: then it is gone now, and the upload begins anew.
    if (absl::IsDeadlineExceeded(status) ||
        (offset > 0 && absl::IsInvalidArgument(status))) {
      status = absl::UnavailableError(status.message());
    }
  } while (backoff.Again(status));
  return stop.stop_requested() && !status.ok() ? Stopped() : status;
}

absl::StatusOr<std::optional<std::uint64_t>> IsomatchClient::FindReceived(
    const v1::Digest& digest, const std::stop_token& stop) {
  v1::FindMissingMeshesRequest request;
  *request.add_digests() = digest;
  v1::FindMissingMeshesResponse response;
  ISOMATCH_RETURN_IF_ERROR(Retry(stop, [&](grpc::ClientContext* context) {
    return stub_->FindMissingMeshes(context, request, &response);
  }));
  if (response.missing().empty()) return std::nullopt;
  // Servers before uploads could be resumed say nothing.
  return response.received_bytes().empty() ? 0 : response.received_bytes(0);
}

absl::Status IsomatchClient::SendFrom(std::uint64_t offset,
                                      const std::string& bytes,
                                      const v1::Digest& digest,
                                      std::uint64_t chunk_bytes,
                                      const std::stop_token& stop) {
  const std::size_t step = chunk_bytes == 0 ? kDefaultChunkBytes : chunk_bytes;
  StoppableContext context(stop);
  v1::UploadMeshResponse response;
  const auto writer = stub_->UploadMesh(context.get(), &response);
  v1::UploadMeshRequest part;
  *part.mutable_header() = digest;
  part.set_offset(offset);
  // A write fails when the server has answered already: known, or refused.
  bool goes_on = writer->Write(part);
  part.clear_offset();
  for (std::size_t at = offset; goes_on && at < bytes.size(); at += step) {
    part.set_chunk(bytes.substr(at, step));
    goes_on = writer->Write(part);
  }
  if (goes_on) writer->WritesDone();
  return OfCall(writer->Finish(), stop);
}

absl::StatusOr<v1::Job> IsomatchClient::CreateJob(
    const v1::CreateJobRequest& request, const std::stop_token& stop) {
  v1::CreateJobResponse response;
  // Not cut short by `stop`: without the name the job could not be cancelled.
  Backoff backoff(stop);
  absl::Status status;
  do {
    grpc::ClientContext context;
    status = OfCall(stub_->CreateJob(&context, request, &response), stop);
  } while (backoff.Again(status));
  ISOMATCH_RETURN_IF_ERROR(status);
  return response.job();
}

absl::StatusOr<v1::Job> IsomatchClient::WatchToEnd(
    const v1::Job& created, const JobCallback& on_change,
    const std::stop_token& stop) {
  v1::WatchJobRequest request;
  request.set_name(created.name());
  Backoff backoff(stop);
  absl::Status status;
  do {
    StoppableContext context(stop);
    const auto reader = stub_->WatchJob(context.get(), request);
    v1::WatchJobResponse response;
    while (reader->Read(&response)) {
      backoff.Reset();
      request.set_after_sequence(response.job().sequence());
      if (on_change) on_change(response.job());
      if (IsTerminal(response.job())) return response.job();
    }
    status = OfCall(reader->Finish(), stop);
    if (status.ok()) {
      status = absl::UnavailableError("the server ended the watch early");
    }
  } while (backoff.Again(status));
  if (!stop.stop_requested()) return JobLost(status);
  // What went wrong while cancelling is not what the user wants to know.
  CancelJob(created.name()).IgnoreError();
  return Stopped();
}

absl::Status IsomatchClient::CancelJob(const std::string& name) {
  grpc::ClientContext context;
  context.set_deadline(absl::ToChronoTime(absl::Now() + kCancelTimeout));
  v1::CancelJobRequest request;
  request.set_name(name);
  v1::CancelJobResponse response;
  return FromGrpc(stub_->CancelJob(&context, request, &response));
}

absl::StatusOr<MatchResult> IsomatchClient::Fetch(const MatchRequest& request,
                                                  const v1::Job& job,
                                                  const std::stop_token& stop) {
  MatchResult result;
  result.info = job.result();
  result.memory_estimate_bytes = job.memory_estimate_bytes();
  const PairSize size{request.mesh_x.num_vertices(),
                      request.mesh_y.num_vertices()};
  std::vector<v1::ResultPart> parts = {v1::RESULT_PART_MAP};
  parts.insert(parts.end(), request.parts.begin(), request.parts.end());
  for (const v1::ResultPart part : parts) {
    const v1::Digest* const digest = FindDigest(result.info, part);
    if (digest == nullptr) continue;
    ISOMATCH_ASSIGN_OR_RETURN(const std::string bytes,
                              Download(job.name(), part, stop));
    ISOMATCH_RETURN_IF_ERROR(CheckDigest(bytes, *digest));
    ISOMATCH_RETURN_IF_ERROR(SetPart(part, bytes, size, result));
  }
  return result;
}

absl::StatusOr<std::string> IsomatchClient::Download(
    const std::string& name, v1::ResultPart part, const std::stop_token& stop) {
  v1::DownloadResultRequest request;
  request.set_name(name);
  request.set_part(part);
  std::string bytes;
  Backoff backoff(stop);
  absl::Status status;
  do {
    StoppableContext context(stop);
    request.set_offset(bytes.size());
    const auto reader = stub_->DownloadResult(context.get(), request);
    v1::DownloadResultResponse response;
    while (reader->Read(&response)) {
      if (response.has_chunk()) backoff.Reset();
      bytes += response.chunk();
    }
    status = OfCall(reader->Finish(), stop);
  } while (backoff.Again(status));
  if (!status.ok() && stop.stop_requested()) return Stopped();
  ISOMATCH_RETURN_IF_ERROR(JobLost(status));
  return bytes;
}

}  // namespace isomatch
