#include "client/api/isomatch_client.h"

#include <algorithm>
#include <cstddef>
#include <future>
#include <utility>

#include <grpcpp/client_context.h>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "client/api/call_retry.h"
#include "client/api/rpc_status.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

constexpr std::uint64_t kDefaultChunkBytes = 64 << 10;

// What a server gets to answer for the first time: the address may be wrong.
constexpr absl::Duration kFirstContact = absl::Seconds(3);

// What telling the server to cancel may take.
constexpr absl::Duration kCancelTimeout = absl::Seconds(3);

// A job the server does not know any more is not the user's mistake.
absl::Status JobLost(const absl::Status& status) {
  if (status.code() != absl::StatusCode::kNotFound) return status;
  return absl::InternalError(
      absl::StrCat("the server has forgotten the job: ", status.message()));
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
    case v1::RESULT_PART_MASK_Y: {
      ISOMATCH_ASSIGN_OR_RETURN(result.matched_y, DecodeMask(bytes, size));
      break;
    }
    default:
      return absl::InvalidArgumentError(
          absl::StrCat("part ", part, ", expected a ResultPart"));
  }
  return absl::OkStatus();
}

bool IsMeshMissing(const absl::Status& status) {
  return ErrorReason(status) == "MESH_MISSING";
}

}  // namespace

bool IsTerminal(const v1::Job& job) {
  return job.state() == v1::Job::STATE_SUCCEEDED ||
         job.state() == v1::Job::STATE_FAILED ||
         job.state() == v1::Job::STATE_CANCELLED;
}

absl::Status OutcomeOf(const v1::Job& job) {
  switch (job.state()) {
    case v1::Job::STATE_SUCCEEDED:
      return absl::OkStatus();
    case v1::Job::STATE_FAILED:
      return WithReason(
          absl::Status(static_cast<absl::StatusCode>(job.error().code()),
                       job.error().message()),
          job.error().reason());
    case v1::Job::STATE_CANCELLED:
      return absl::CancelledError("the job was cancelled on the server");
    default:
      return absl::FailedPreconditionError(
          absl::StrCat(job.name(), " has not ended yet"));
  }
}

IsomatchClient::IsomatchClient(const std::shared_ptr<grpc::Channel>& channel,
                               absl::Duration patience, bool is_local)
    : stub_(v1::CorrespondenceService::NewStub(channel)),
      patience_(patience),
      draco_{.is_local = is_local} {}

absl::StatusOr<v1::GetServerInfoResponse> IsomatchClient::GetServerInfo(
    const std::stop_token& stop) {
  const absl::Duration patience =
      patience_ > kPatience ? patience_ : std::min(patience_, kFirstContact);
  const auto deadline =
      absl::ToChronoTime(absl::Now() + std::max(patience, kFirstContact));
  v1::GetServerInfoResponse response;
  // The first attempt says what is wrong; the next ones wait for a server that
  // is about to start. (A call that fails at once does not keep gRPC
  // connecting.)
  std::string refusal;
  const absl::Status status =
      Retry(stop, patience, [&](grpc::ClientContext* context) {
        context->set_deadline(deadline);
        context->set_wait_for_ready(!refusal.empty());
        grpc::Status attempt = stub_->GetServerInfo(context, {}, &response);
        if (refusal.empty()) refusal = attempt.error_message();
        return attempt;
      });
  if (status.ok()) return response;
  if (status.code() != absl::StatusCode::kUnavailable &&
      status.code() != absl::StatusCode::kDeadlineExceeded) {
    return status;
  }
  return absl::UnavailableError(
      absl::StrCat("no answer within ", absl::FormatDuration(patience),
                   ", expected a running isomatch-server: ", refusal));
}

absl::StatusOr<MatchResult> IsomatchClient::Match(const MatchRequest& request,
                                                  const JobCallback& on_change,
                                                  const std::stop_token& stop) {
  // Nobody else knows the job's name.
  ISOMATCH_ASSIGN_OR_RETURN(
      const v1::Job created,
      Create(request, v1::DISCONNECT_POLICY_CANCEL, stop));
  ISOMATCH_ASSIGN_OR_RETURN(const v1::Job job,
                            WatchOrCancel(created.name(), on_change, stop));
  ISOMATCH_RETURN_IF_ERROR(OutcomeOf(job));
  ISOMATCH_ASSIGN_OR_RETURN(MatchResult result,
                            Fetch(job, request.parts, stop));
  if (result.size.vertices_x == request.mesh_x.num_vertices() &&
      result.size.vertices_y == request.mesh_y.num_vertices()) {
    return result;
  }
  return absl::DataLossError(absl::StrCat(
      "the result is a map of ", result.size.vertices_x, " vertices to ",
      result.size.vertices_y, ", expected ", request.mesh_x.num_vertices(),
      " and ", request.mesh_y.num_vertices()));
}

absl::StatusOr<v1::Job> IsomatchClient::Submit(const MatchRequest& request,
                                               const std::stop_token& stop) {
  return Create(request, v1::DISCONNECT_POLICY_KEEP, stop);
}

absl::StatusOr<v1::Job> IsomatchClient::Create(const MatchRequest& request,
                                               v1::DisconnectPolicy policy,
                                               const std::stop_token& stop) {
  ISOMATCH_ASSIGN_OR_RETURN(const v1::GetServerInfoResponse server,
                            GetServerInfo(stop));
  EncodedPair meshes;
  // By a thread, where there can be one: large meshes take a second.
  std::future<absl::StatusOr<EncodedMesh>> x =
      std::async([&] { return EncodeDraco(request.mesh_x, draco_); });
  absl::StatusOr<EncodedMesh> y = EncodeDraco(request.mesh_y, draco_);
  ISOMATCH_ASSIGN_OR_RETURN(meshes.x, x.get());
  ISOMATCH_ASSIGN_OR_RETURN(meshes.y, std::move(y));
  const v1::GetServerInfoResponse::Limits& limits = server.limits();
  const bool is_inline =
      FitsOneRequest(meshes, request, limits.max_request_bytes());
  v1::CreateJobRequest message =
      MakeCreateJobRequest(request, meshes, is_inline);
  message.set_disconnect_policy(policy);
  if (is_inline) return SendCreateJob(message, stop);
  const auto upload_and_send = [&]() -> absl::StatusOr<v1::Job> {
    const std::uint64_t chunk = limits.max_chunk_bytes();
    std::future<absl::Status> sent_x =
        std::async([&] { return Upload(meshes.x.bytes, chunk, stop); });
    ISOMATCH_RETURN_IF_ERROR(Upload(meshes.y.bytes, chunk, stop));
    ISOMATCH_RETURN_IF_ERROR(sent_x.get());
    return SendCreateJob(message, stop);
  };
  absl::StatusOr<v1::Job> job = upload_and_send();
  // A mesh that the server had may be gone since: with the last job that named
  // it, or damaged, which shows when it is read.
  if (IsMeshMissing(job.status())) job = upload_and_send();
  return job;
}

absl::StatusOr<bool> IsomatchClient::UploadMesh(const TriangleMesh& mesh,
                                                v1::Digest* digest,
                                                const std::stop_token& stop) {
  ISOMATCH_ASSIGN_OR_RETURN(const v1::GetServerInfoResponse server,
                            GetServerInfo(stop));
  ISOMATCH_ASSIGN_OR_RETURN(const EncodedMesh encoded,
                            EncodeDraco(mesh, draco_));
  *digest = DigestOf(encoded.bytes);
  ISOMATCH_ASSIGN_OR_RETURN(const std::optional<std::uint64_t> received,
                            FindReceived(*digest, stop));
  if (!received) return true;
  ISOMATCH_RETURN_IF_ERROR(
      Upload(encoded.bytes, server.limits().max_chunk_bytes(), stop));
  return false;
}

absl::Status IsomatchClient::Upload(const std::string& bytes,
                                    std::uint64_t chunk_bytes,
                                    const std::stop_token& stop) {
  const v1::Digest digest = DigestOf(bytes);
  Backoff backoff(stop, patience_);
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
  ISOMATCH_RETURN_IF_ERROR(
      Retry(stop, patience_, [&](grpc::ClientContext* context) {
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

absl::StatusOr<v1::Job> IsomatchClient::SendCreateJob(
    const v1::CreateJobRequest& request, const std::stop_token& stop) {
  v1::CreateJobResponse response;
  // Not cut short by `stop`: without the name the job could not be cancelled.
  Backoff backoff(stop, patience_);
  absl::Status status;
  do {
    grpc::ClientContext context;
    status = OfCall(stub_->CreateJob(&context, request, &response), stop);
  } while (backoff.Again(status));
  ISOMATCH_RETURN_IF_ERROR(status);
  return response.job();
}

absl::StatusOr<v1::Job> IsomatchClient::Watch(const std::string& name,
                                              const JobCallback& on_change,
                                              const std::stop_token& stop) {
  v1::WatchJobRequest request;
  request.set_name(name);
  Backoff backoff(stop, patience_);
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
  return stop.stop_requested() ? Stopped() : status;
}

absl::StatusOr<v1::Job> IsomatchClient::WatchOrCancel(
    const std::string& name, const JobCallback& on_change,
    const std::stop_token& stop) {
  absl::StatusOr<v1::Job> job = Watch(name, on_change, stop);
  if (job.ok()) return job;
  if (!stop.stop_requested()) return JobLost(job.status());
  // Not with `stop`, and not for long. What went wrong while cancelling is not
  // what the user wants to know.
  grpc::ClientContext context;
  context.set_deadline(absl::ToChronoTime(absl::Now() + kCancelTimeout));
  v1::CancelJobRequest request;
  request.set_name(name);
  v1::CancelJobResponse response;
  stub_->CancelJob(&context, request, &response);
  return Stopped();
}

absl::StatusOr<v1::Job> IsomatchClient::GetJob(const std::string& name,
                                               const std::stop_token& stop) {
  v1::GetJobRequest request;
  request.set_name(name);
  v1::GetJobResponse response;
  ISOMATCH_RETURN_IF_ERROR(
      Retry(stop, patience_, [&](grpc::ClientContext* context) {
        return stub_->GetJob(context, request, &response);
      }));
  return response.job();
}

absl::StatusOr<std::vector<v1::Job>> IsomatchClient::ListJobs(
    const JobQuery& query, const std::stop_token& stop) {
  constexpr std::size_t kPageSize = 1000;
  v1::ListJobsRequest request;
  for (const v1::Job::State state : query.states) request.add_states(state);
  request.mutable_labels()->insert(query.labels.begin(), query.labels.end());
  std::vector<v1::Job> jobs;
  do {
    request.set_page_size(static_cast<std::uint32_t>(
        std::min(kPageSize, query.limit - jobs.size())));
    v1::ListJobsResponse response;
    ISOMATCH_RETURN_IF_ERROR(
        Retry(stop, patience_, [&](grpc::ClientContext* context) {
          return stub_->ListJobs(context, request, &response);
        }));
    jobs.insert(jobs.end(), response.jobs().begin(), response.jobs().end());
    request.set_page_token(response.next_page_token());
  } while (!request.page_token().empty() && jobs.size() < query.limit);
  return jobs;
}

absl::StatusOr<v1::Job> IsomatchClient::CancelJob(const std::string& name,
                                                  const std::stop_token& stop) {
  v1::CancelJobRequest request;
  request.set_name(name);
  v1::CancelJobResponse response;
  ISOMATCH_RETURN_IF_ERROR(
      Retry(stop, patience_, [&](grpc::ClientContext* context) {
        return stub_->CancelJob(context, request, &response);
      }));
  return response.job();
}

absl::Status IsomatchClient::DeleteJob(const std::string& name,
                                       const std::stop_token& stop) {
  v1::DeleteJobRequest request;
  request.set_name(name);
  v1::DeleteJobResponse response;
  return Retry(stop, patience_, [&](grpc::ClientContext* context) {
    return stub_->DeleteJob(context, request, &response);
  });
}

absl::StatusOr<MatchResult> IsomatchClient::Fetch(
    const v1::Job& job, const std::vector<v1::ResultPart>& parts,
    const std::stop_token& stop) {
  MatchResult result;
  result.info = job.result();
  result.memory_estimate_bytes = job.memory_estimate_bytes();
  std::vector<v1::ResultPart> wanted = {v1::RESULT_PART_MAP};
  wanted.insert(wanted.end(), parts.begin(), parts.end());
  for (const v1::ResultPart part : wanted) {
    const v1::Digest* const digest = FindDigest(result.info, part);
    if (digest == nullptr) continue;
    ISOMATCH_ASSIGN_OR_RETURN(const DownloadedPart downloaded,
                              Download(job.name(), part, stop));
    ISOMATCH_RETURN_IF_ERROR(CheckDigest(downloaded.bytes, *digest));
    result.size = downloaded.size;
    ISOMATCH_RETURN_IF_ERROR(
        SetPart(part, downloaded.bytes, downloaded.size, result));
  }
  return result;
}

absl::StatusOr<IsomatchClient::DownloadedPart> IsomatchClient::Download(
    const std::string& name, v1::ResultPart part, const std::stop_token& stop) {
  v1::DownloadResultRequest request;
  request.set_name(name);
  request.set_part(part);
  DownloadedPart downloaded;
  Backoff backoff(stop, patience_);
  absl::Status status;
  do {
    StoppableContext context(stop);
    request.set_offset(downloaded.bytes.size());
    const auto reader = stub_->DownloadResult(context.get(), request);
    v1::DownloadResultResponse response;
    while (reader->Read(&response)) {
      if (response.has_header()) {
        const v1::DownloadResultResponse::Header& header = response.header();
        downloaded.size = {static_cast<VertexIndex>(header.vertices_x()),
                           static_cast<VertexIndex>(header.vertices_y())};
      } else {
        backoff.Reset();
        downloaded.bytes += response.chunk();
      }
    }
    status = OfCall(reader->Finish(), stop);
  } while (backoff.Again(status));
  if (!status.ok() && stop.stop_requested()) return Stopped();
  ISOMATCH_RETURN_IF_ERROR(JobLost(status));
  return downloaded;
}

}  // namespace isomatch
