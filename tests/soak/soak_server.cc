#include "tests/soak/soak_server.h"

#include <algorithm>
#include <fstream>
#include <utility>

#include <gtest/gtest.h>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/sha256.h"
#include "grpc/health/v1/health.grpc.pb.h"
#include "tests/server/test_server.h"

namespace isomatch {

absl::Status OutcomeOfCall(const grpc::Status& status) {
  if (status.ok()) return absl::OkStatus();
  return {static_cast<absl::StatusCode>(status.error_code()),
          absl::StrCat(ErrorOf(status).reason, ": ", status.error_message())};
}

namespace {

std::vector<std::string> Durable(std::vector<std::string> flags,
                                 const TemporaryFolder& folder) {
  const auto has = [&](const char* flag) {
    return std::find(flags.begin(), flags.end(), flag) != flags.end();
  };
  if (!has("--data-dir") && !has("--ephemeral")) {
    flags.insert(flags.end(), {"--data-dir", folder.Path("data")});
  }
  return flags;
}

}  // namespace

SoakServer::SoakServer(std::vector<std::string> flags)
    : server_(ISOMATCH_SERVER_BINARY, Durable(std::move(flags), folder_)),
      log_reader_([this] { server_.process.ReadLines(); }),
      channel_(Connect()),
      stub_(v1::CorrespondenceService::NewStub(channel_)) {}

SoakServer::~SoakServer() {
  if (server_.process.id() > 0) {
    Signal(SIGKILL);
    server_.process.ExitStatus();
  }
  log_reader_.join();
}

std::shared_ptr<grpc::Channel> SoakServer::Connect() const {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  return grpc::CreateCustomChannel(
      address(), grpc::InsecureChannelCredentials(), arguments);
}

int SoakServer::ExitStatus() { return server_.process.ExitStatus(); }

std::int64_t SoakServer::ResidentBytes() const {
  std::ifstream status(absl::StrCat("/proc/", server_.process.id(), "/status"));
  std::string word;
  while (status >> word) {
    std::int64_t kibibytes = 0;
    if (word == "VmRSS:" && status >> kibibytes) return kibibytes << 10;
  }
  ADD_FAILURE() << "no VmRSS: has the server ended?";
  return 0;
}

std::int64_t SoakServer::SettledResidentBytes() const {
  std::int64_t before = ResidentBytes();
  for (int i = 0; i < 40; ++i) {
    absl::SleepFor(absl::Milliseconds(500));
    const std::int64_t now = ResidentBytes();
    if (std::abs(now - before) < (1 << 20)) return now;
    before = now;
  }
  return before;
}

CallContext::CallContext(const std::string& key) {
  set_deadline(absl::ToChronoTime(absl::Now() + absl::Minutes(2)));
  if (!key.empty()) AddMetadata("api-key", key);
}

absl::StatusOr<v1::Job> CreateJob(Stub& stub,
                                  const v1::CreateJobRequest& request,
                                  const std::string& key) {
  CallContext context(key);
  v1::CreateJobResponse response;
  const grpc::Status status = stub.CreateJob(&context, request, &response);
  if (!status.ok()) return OutcomeOfCall(status);
  return response.job();
}

absl::StatusOr<v1::Job> GetJob(Stub& stub, const std::string& name,
                               const std::string& key) {
  CallContext context(key);
  v1::GetJobRequest request;
  request.set_name(name);
  v1::GetJobResponse response;
  const grpc::Status status = stub.GetJob(&context, request, &response);
  if (!status.ok()) return OutcomeOfCall(status);
  return response.job();
}

absl::StatusOr<v1::Job> CancelJob(Stub& stub, const std::string& name,
                                  const std::string& key) {
  CallContext context(key);
  v1::CancelJobRequest request;
  request.set_name(name);
  v1::CancelJobResponse response;
  const grpc::Status status = stub.CancelJob(&context, request, &response);
  if (!status.ok()) return OutcomeOfCall(status);
  return response.job();
}

absl::Status DeleteJob(Stub& stub, const std::string& name,
                       const std::string& key) {
  CallContext context(key);
  v1::DeleteJobRequest request;
  request.set_name(name);
  v1::DeleteJobResponse response;
  return OutcomeOfCall(stub.DeleteJob(&context, request, &response));
}

absl::Status UploadMesh(Stub& stub, const std::string& bytes,
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
  return OutcomeOfCall(writer->Finish());
}

v1::GetServerInfoResponse GetInfo(Stub& stub) {
  CallContext context;
  v1::GetServerInfoResponse info;
  const grpc::Status status = stub.GetServerInfo(&context, {}, &info);
  EXPECT_TRUE(status.ok()) << status.error_message();
  return info;
}

absl::StatusOr<v1::Job> WaitForEnd(Stub& stub, const std::string& name,
                                   const std::string& key) {
  CallContext context(key);
  v1::WatchJobRequest request;
  request.set_name(name);
  const auto reader = stub.WatchJob(&context, request);
  v1::WatchJobResponse last;
  while (reader->Read(&last)) {
  }
  const grpc::Status status = reader->Finish();
  if (!status.ok()) return OutcomeOfCall(status);
  return last.job();
}

void WaitUntilRuns(Stub& stub, const std::string& name) {
  CallContext context;
  v1::WatchJobRequest request;
  request.set_name(name);
  const auto reader = stub.WatchJob(&context, request);
  v1::WatchJobResponse last;
  while (reader->Read(&last)) {
    if (last.job().state() == v1::Job::STATE_QUEUED) continue;
    context.TryCancel();
  }
  (void)reader->Finish();
}

absl::StatusOr<std::string> Download(Stub& stub, const std::string& name,
                                     v1::ResultPart part, std::uint64_t offset,
                                     const std::string& key) {
  CallContext context(key);
  v1::DownloadResultRequest request;
  request.set_name(name);
  request.set_part(part);
  request.set_offset(offset);
  const auto reader = stub.DownloadResult(&context, request);
  std::string bytes;
  v1::DownloadResultResponse response;
  while (reader->Read(&response)) bytes += response.chunk();
  const grpc::Status status = reader->Finish();
  if (!status.ok()) return OutcomeOfCall(status);
  return bytes;
}

bool IsServing(const std::shared_ptr<grpc::Channel>& channel) {
  using Response = grpc::health::v1::HealthCheckResponse;
  CallContext context;
  Response response;
  const grpc::Status status = grpc::health::v1::Health::NewStub(channel)->Check(
      &context, {}, &response);
  return status.ok() && response.status() == Response::SERVING;
}

std::string ReasonOf(const absl::Status& status) {
  const std::string message(status.message());
  return message.substr(0, message.find(':'));
}

bool IsEnd(v1::Job::State state) {
  return state == v1::Job::STATE_SUCCEEDED || state == v1::Job::STATE_FAILED ||
         state == v1::Job::STATE_CANCELLED;
}

}  // namespace isomatch
