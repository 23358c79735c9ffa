#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include "absl/time/time.h"
#include "core/mesh/triangle_mesh.h"
#include "google/rpc/error_details.pb.h"
#include "isomatch/v1/service.grpc.pb.h"
#include "server/server.h"

namespace isomatch {

/// What a call failed with, as a client reads it.
struct CallError {
  grpc::StatusCode code;
  std::string reason;
  std::string field;
  bool has_retry = false;
};
CallError ErrorOf(const grpc::Status& status);

/// The file of --api-keys of tenants that may submit, whose keys are their
/// names.
std::string KeysOf(const std::vector<std::string>& tenants);

absl::Time ToTime(const google::protobuf::Timestamp& proto);

/// The mesh of a job, as Draco bytes that keep the order of the vertices.
v1::Mesh ToDraco(const TriangleMesh& mesh);

/// Gives `found`, a map of some vertices to four, all parts and figures, each
/// with numbers of its own. The functional map only if the options ask for it.
void FindEverything(absl::Span<const Landmark> landmarks,
                    const MatchOptions& options, Correspondence& found);

/// A real server on a free port with a method that the test controls: it waits
/// until `gate` is open and maps vertex i to vertex i % |Y|.
class TestServer : public testing::Test {
 protected:
  TestServer();
  ~TestServer() override;

  /// Starts the server again with this configuration.
  void Restart(ServerConfig config);
  void Restart(ServerConfig config, MatchEngine engine);

  v1::CreateJobRequest SphereJob() const;
  std::string CreateJob();
  std::string CreateJob(const v1::CreateJobRequest& request);
  v1::Job GetJob(const std::string& name);

  /// Calls CreateJob and returns how it failed.
  CallError CreateError(const v1::CreateJobRequest& request);

  /// Reads a whole watch and checks that it ends with OK.
  std::vector<v1::Job> Watch(const std::string& name,
                             std::uint64_t after_sequence = 0);

  /// Waits until the method has been called `count` times in all.
  void WaitForMatches(int count) const;

  static ServerConfig TestConfig();
  MatchEngine GatedEngine();

  /// What else the method finds; set before a job is created.
  std::function<void(absl::Span<const Landmark>, const MatchOptions&,
                     Correspondence&)>
      on_found_;
  std::atomic<bool> gate_open_ = true;
  std::atomic<int> matches_ = 0;
  std::unique_ptr<Server> server_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::CorrespondenceService::Stub> stub_;
};

}  // namespace isomatch
