#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <grpcpp/grpcpp.h>

#include "absl/status/statusor.h"
#include "isomatch/v1/service.grpc.pb.h"
#include "tests/server/child_process.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {

using Stub = v1::CorrespondenceService::Stub;

/// isomatch-server as a process of its own, whose log is read and dropped, with
/// a connection to it. Killed at the end.
class SoakServer {
 public:
  /// With a data folder of its own unless the flags name one, or --ephemeral.
  explicit SoakServer(std::vector<std::string> flags = {});
  ~SoakServer();

  const std::string& address() const { return server_.address; }
  Stub& stub() { return *stub_; }
  std::shared_ptr<grpc::Channel> channel() { return channel_; }
  /// Returns a connection of its own.
  std::shared_ptr<grpc::Channel> Connect() const;

  void Signal(int signal) const { server_.process.Signal(signal); }
  /// Waits for its end; -1 when a signal killed it.
  int ExitStatus();

  std::int64_t ResidentBytes() const;
  /// Waits until ResidentBytes changes by less than 1 MiB in half a second,
  /// 20 s at most, and returns it.
  std::int64_t SettledResidentBytes() const;

 private:
  const TemporaryFolder folder_;
  ServerProcess server_;
  std::thread log_reader_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<Stub> stub_;
};

/// A context with a deadline that only a server which hangs exceeds, and with
/// the API key, if there is one.
class CallContext : public grpc::ClientContext {
 public:
  explicit CallContext(const std::string& key = "");
};

/// Its message begins with the reason; see ReasonOf.
absl::Status OutcomeOfCall(const grpc::Status& status);

// Single calls.

absl::StatusOr<v1::Job> CreateJob(Stub& stub,
                                  const v1::CreateJobRequest& request,
                                  const std::string& key = "");
absl::StatusOr<v1::Job> GetJob(Stub& stub, const std::string& name,
                               const std::string& key = "");
absl::StatusOr<v1::Job> CancelJob(Stub& stub, const std::string& name,
                                  const std::string& key = "");
absl::Status DeleteJob(Stub& stub, const std::string& name,
                       const std::string& key = "");
/// In chunks of 1 MiB.
absl::Status UploadMesh(Stub& stub, const std::string& bytes,
                        const std::string& key = "");
v1::GetServerInfoResponse GetInfo(Stub& stub);
/// Watches until the job is terminal and returns it.
absl::StatusOr<v1::Job> WaitForEnd(Stub& stub, const std::string& name,
                                   const std::string& key = "");
/// Waits until a job is RUNNING, or terminal.
void WaitUntilRuns(Stub& stub, const std::string& name);
absl::StatusOr<std::string> Download(Stub& stub, const std::string& name,
                                     v1::ResultPart part,
                                     std::uint64_t offset = 0,
                                     const std::string& key = "");
/// Whether grpc.health.v1 says SERVING.
bool IsServing(const std::shared_ptr<grpc::Channel>& channel);

/// Returns the reason in a status that one of these calls returned.
std::string ReasonOf(const absl::Status& status);

bool IsEnd(v1::Job::State state);

}  // namespace isomatch
