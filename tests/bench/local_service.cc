#include "tests/bench/local_service.h"

#include <cstdlib>
#include <system_error>
#include <utility>

#include <grpcpp/grpcpp.h>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "client/api/rpc_status.h"
#include "core/base/status_macros.h"
#include "core/io/result_bytes.h"

namespace isomatch::bench {
namespace {

double SecondsOf(const google::protobuf::Timestamp& time) {
  return double(time.seconds()) + 1e-9 * double(time.nanos());
}

double NowSeconds() {
  return absl::ToDoubleSeconds(absl::Now() - absl::UnixEpoch());
}

/// When the client began, knew of the end, and had the map; seconds since 1970.
struct ClientTimes {
  double begin = 0;
  double told = 0;
  double end = 0;
};

/// The server's times and the client's are of one clock.
ServiceSeconds Split(const v1::Job& job, const ClientTimes& client) {
  double stages = 0;
  for (const v1::StageTime& stage : job.result().stage_times()) {
    stages += stage.seconds();
  }
  const double run = job.result().run_seconds();
  const double create = SecondsOf(job.create_time());
  const double start = SecondsOf(job.start_time());
  const double end = SecondsOf(job.end_time());
  return {.submit = create - client.begin,
          .accept = start - create,
          .load = run - stages,
          .match = stages,
          .store = end - start - run,
          .watch = client.told - end,
          .download = client.end - client.told};
}

absl::StatusOr<std::filesystem::path> MakeTemporaryFolder() {
  std::error_code error;
  std::string path =
      (std::filesystem::temp_directory_path(error) / "isomatch_bench_XXXXXX")
          .string();
  if (error || mkdtemp(path.data()) == nullptr) {
    return absl::UnavailableError(absl::StrCat("cannot make a folder ", path));
  }
  return path;
}

}  // namespace

absl::StatusOr<std::unique_ptr<LocalService>> LocalService::Start(
    ServerConfig config) {
  std::unique_ptr<LocalService> service(new LocalService);
  ISOMATCH_ASSIGN_OR_RETURN(service->folder_, MakeTemporaryFolder());
  config.listen = "127.0.0.1:0";
  config.data_dir = service->folder_.string();
  ISOMATCH_ASSIGN_OR_RETURN(service->server_, Server::Create(config));
  service->stub_ = v1::CorrespondenceService::NewStub(grpc::CreateChannel(
      service->server_->address(), grpc::InsecureChannelCredentials()));
  return service;
}

LocalService::~LocalService() {
  stub_.reset();
  server_.reset();
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

absl::StatusOr<v1::Job> LocalService::Submit(
    const v1::CreateJobRequest& request) const {
  grpc::ClientContext context;
  v1::CreateJobResponse response;
  ISOMATCH_RETURN_IF_ERROR(
      FromGrpc(stub_->CreateJob(&context, request, &response)));
  return response.job();
}

absl::StatusOr<v1::Job> LocalService::WatchToEnd(
    const std::string& name) const {
  grpc::ClientContext context;
  v1::WatchJobRequest request;
  request.set_name(name);
  const auto reader = stub_->WatchJob(&context, request);
  v1::WatchJobResponse response;
  while (reader->Read(&response)) {
  }
  ISOMATCH_RETURN_IF_ERROR(FromGrpc(reader->Finish()));
  const v1::Job& job = response.job();
  if (job.state() == v1::Job::STATE_SUCCEEDED) return job;
  return absl::InternalError(absl::StrCat(name, " is ",
                                          v1::Job::State_Name(job.state()),
                                          ": ", job.error().message()));
}

absl::StatusOr<std::string> LocalService::Download(
    const std::string& name) const {
  grpc::ClientContext context;
  v1::DownloadResultRequest request;
  request.set_name(name);
  const auto reader = stub_->DownloadResult(&context, request);
  std::string bytes;
  for (v1::DownloadResultResponse part; reader->Read(&part);) {
    bytes += part.chunk();
  }
  ISOMATCH_RETURN_IF_ERROR(FromGrpc(reader->Finish()));
  return bytes;
}

absl::StatusOr<ServiceRun> LocalService::Run(
    const v1::CreateJobRequest& request) const {
  ClientTimes times{.begin = NowSeconds()};
  ISOMATCH_ASSIGN_OR_RETURN(const v1::Job created, Submit(request));
  ISOMATCH_ASSIGN_OR_RETURN(const v1::Job job, WatchToEnd(created.name()));
  times.told = NowSeconds();
  ISOMATCH_ASSIGN_OR_RETURN(const std::string bytes, Download(job.name()));
  times.end = NowSeconds();
  const PairSize size = {
      static_cast<VertexIndex>(job.result().mesh_x().vertices()),
      static_cast<VertexIndex>(job.result().mesh_y().vertices())};
  ServiceRun run{Split(job, times), {}};
  ISOMATCH_ASSIGN_OR_RETURN(run.y_from_x, DecodeMap(bytes, size));
  return run;
}

}  // namespace isomatch::bench
