#include "tests/server/test_server.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/sha256.h"
#include "core/io/draco_mesh.h"
#include "core/pipeline/shape_contents.h"
#include "google/rpc/status.pb.h"
#include "tests/support/shapes.h"
#include "tests/support/unprepared_engine.h"

namespace isomatch {

std::string KeysOf(const std::vector<std::string>& tenants) {
  std::string keys;
  for (const std::string& name : tenants) {
    absl::StrAppend(&keys, name, " ", name, " submit ", Sha256Hex(name), "\n");
  }
  return keys;
}

CallError ErrorOf(const grpc::Status& status) {
  CallError error{status.error_code(), "", ""};
  google::rpc::Status details;
  EXPECT_TRUE(details.ParseFromString(status.error_details()));
  for (const auto& any : details.details()) {
    google::rpc::ErrorInfo info;
    google::rpc::BadRequest bad_request;
    if (any.UnpackTo(&info)) error.reason = info.reason();
    if (any.UnpackTo(&bad_request)) {
      error.field = bad_request.field_violations(0).field();
    }
    if (any.Is<google::rpc::RetryInfo>()) error.has_retry = true;
  }
  return error;
}

absl::Time ToTime(const google::protobuf::Timestamp& proto) {
  return absl::FromUnixSeconds(proto.seconds()) +
         absl::Nanoseconds(proto.nanos());
}

v1::Mesh ToDraco(const TriangleMesh& mesh) {
  const auto encoded = EncodeDraco(mesh);
  EXPECT_TRUE(encoded.ok());
  v1::Mesh proto;
  proto.set_draco(encoded->bytes);
  proto.set_vertex_order(encoded->vertex_order == VertexOrder::kDecoded
                             ? v1::VERTEX_ORDER_DECODED
                             : v1::VERTEX_ORDER_ID_ATTRIBUTE);
  proto.set_vertex_count(static_cast<std::uint32_t>(mesh.num_vertices()));
  return proto;
}

void FindEverything(absl::Span<const Landmark> landmarks,
                    const MatchOptions& options, Correspondence& found) {
  constexpr VertexIndex kVerticesY = 4;
  VertexMap other;
  for (const VertexIndex y : found.y_from_x) {
    const VertexIndex next = (y + 1) % kVerticesY;
    const VertexIndex after = (y + 2) % kVerticesY;
    found.precise.push_back({{y, next, after}, {0.5, 0.375, 0.125}});
    found.confidence.push_back(
        1 / (2 + static_cast<float>(found.confidence.size())));
    other.push_back(next);
  }
  found.matched_y = {1, 0, 1, 1};
  found.scores = {1, -0.5, 3, 4, 1.5, 5, 0.25, 7};
  found.alternatives = {{other, {8, 9, 10, 11, 0.5, 12, 13, 14}},
                        {found.y_from_x, {.rank_value = 15}}};
  found.quality = {0.125, 0.875, 0.0625, /*unmatched=*/0,
                   /*mean_confidence=*/0.375};
  found.verdict = {VerdictLevel::kDoubtful, "the reason", "the advice"};
  found.symmetry_confidence = 0.125;
  for (const Landmark& landmark : landmarks) {
    found.landmarks.push_back({found.landmarks.empty(), landmark.y, 0.5});
  }
  if (!options.keep_functional_map) return;
  found.functional_map.resize(2, 2);
  found.functional_map << 1, 2, 3, 4;
  found.eigenvalues_x = Eigen::Vector2d(0, 5);
  found.eigenvalues_y = Eigen::Vector2d(0, 6);
}

TestServer::TestServer() { Restart(TestConfig()); }

TestServer::~TestServer() {
  gate_open_ = true;
  server_->Shutdown(absl::ZeroDuration());
}

ServerConfig TestServer::TestConfig() {
  ServerConfig config;
  config.listen = "127.0.0.1:0";
  config.metrics_listen = "off";
  return config;
}

MatchEngine TestServer::GatedEngine() {
  MatchEngine engine = UnpreparedEngine();
  engine.match =
      [this](const PreparedShape& x, const PreparedShape& y,
             absl::Span<const Landmark> landmarks, const MatchOptions& options,
             const MatchControl& control) -> absl::StatusOr<Correspondence> {
    const std::stop_token& stop = control.stop;
    control.progress({Stage::kGeodesics, 0, 0.1});
    ++matches_;
    while (!gate_open_ && !stop.stop_requested()) {
      absl::SleepFor(absl::Milliseconds(1));
    }
    if (stop.stop_requested()) return absl::CancelledError("cancelled");
    control.progress({Stage::kDense, 0, 0.5});
    Correspondence found;
    const VertexIndex vertices_y = y.contents().mesh->num_vertices();
    for (VertexIndex i = 0; i < x.contents().mesh->num_vertices(); ++i) {
      found.y_from_x.push_back(i % vertices_y);
    }
    if (on_found_) on_found_(landmarks, options, found);
    return found;
  };
  engine.estimate = [](auto&&...) { return std::int64_t{1} << 20; };
  return engine;
}

void TestServer::Restart(ServerConfig config) {
  Restart(std::move(config), GatedEngine());
}

void TestServer::Restart(ServerConfig config, MatchEngine engine) {
  server_.reset();
  auto created = Server::Create(config, std::move(engine));
  ASSERT_TRUE(created.ok()) << created.status();
  server_ = *std::move(created);
  channel_ = grpc::CreateChannel(server_->address(),
                                 grpc::InsecureChannelCredentials());
  stub_ = v1::CorrespondenceService::NewStub(channel_);
}

v1::CreateJobRequest TestServer::SphereJob() const {
  v1::CreateJobRequest request;
  *request.mutable_mesh_x() = ToDraco(UnitSphere(1));
  *request.mutable_mesh_y() = ToDraco(Tetrahedron());
  return request;
}

std::string TestServer::CreateJob() { return CreateJob(SphereJob()); }

std::string TestServer::CreateJob(const v1::CreateJobRequest& request) {
  grpc::ClientContext context;
  v1::CreateJobResponse response;
  const grpc::Status status = stub_->CreateJob(&context, request, &response);
  EXPECT_TRUE(status.ok()) << status.error_message();
  return response.job().name();
}

CallError TestServer::CreateError(const v1::CreateJobRequest& request) {
  grpc::ClientContext context;
  v1::CreateJobResponse response;
  return ErrorOf(stub_->CreateJob(&context, request, &response));
}

v1::Job TestServer::GetJob(const std::string& name) {
  grpc::ClientContext context;
  v1::GetJobRequest request;
  request.set_name(name);
  v1::GetJobResponse response;
  EXPECT_TRUE(stub_->GetJob(&context, request, &response).ok());
  return response.job();
}

std::vector<v1::Job> TestServer::Watch(const std::string& name,
                                       std::uint64_t after_sequence) {
  grpc::ClientContext context;
  v1::WatchJobRequest request;
  request.set_name(name);
  request.set_after_sequence(after_sequence);
  const auto reader = stub_->WatchJob(&context, request);
  std::vector<v1::Job> jobs;
  for (v1::WatchJobResponse response; reader->Read(&response);) {
    jobs.push_back(response.job());
  }
  const grpc::Status status = reader->Finish();
  EXPECT_TRUE(status.ok()) << status.error_message();
  return jobs;
}

void TestServer::WaitForMatches(int count) const {
  while (matches_ < count) absl::SleepFor(absl::Milliseconds(1));
}

}  // namespace isomatch
