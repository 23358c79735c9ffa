#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "core/base/vertex_index.h"
#include "isomatch/v1/service.grpc.pb.h"
#include "server/server.h"

namespace isomatch::bench {

/// Where the time of one job through the service went, in this order, from the
/// first byte sent to the last one received. Their sum is the whole.
struct ServiceSeconds {
  double submit = 0;    ///< sent, decoded, checked, estimated
  double accept = 0;    ///< request, meshes and record stored; queued
  double load = 0;      ///< read and decoded again; the parts encoded
  double match = 0;     ///< all stages of the method
  double store = 0;     ///< RUNNING recorded, the parts stored
  double watch = 0;     ///< SUCCEEDED recorded, the client told
  double download = 0;  ///< the map

  double total() const {
    return submit + accept + load + match + store + watch + download;
  }
};

struct ServiceRun {
  ServiceSeconds seconds;
  VertexMap y_from_x;
};

/// A real server in this process: a loopback port, and a data directory that is
/// removed at the end.
///
/// Thread-safe.
class LocalService {
 public:
  /// Returns the server; `config` says all but address and directory.
  static absl::StatusOr<std::unique_ptr<LocalService>> Start(
      ServerConfig config);
  ~LocalService();

  int threads_per_job() const { return server_->threads_per_job(); }

  /// CreateJob, WatchJob to the end, DownloadResult of the map. The error that
  /// a call or the job ended with.
  absl::StatusOr<ServiceRun> Run(const v1::CreateJobRequest& request) const;

 private:
  LocalService() = default;

  absl::StatusOr<v1::Job> Submit(const v1::CreateJobRequest& request) const;
  absl::StatusOr<v1::Job> WatchToEnd(const std::string& name) const;
  absl::StatusOr<std::string> Download(const std::string& name) const;

  std::filesystem::path folder_;
  std::unique_ptr<Server> server_;
  std::unique_ptr<v1::CorrespondenceService::Stub> stub_;
};

}  // namespace isomatch::bench
