#include "server/server.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <mutex>
#include <utility>
#include <vector>

#include <grpcpp/grpcpp.h>
#include <openssl/rand.h>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/status_macros.h"
#include "core/base/version.h"
#include "server/config/resource_plan.h"
#include "server/convert/result_info.h"
#include "server/convert/stored_request.h"
#include "server/engine/prepared_cache.h"
#include "server/job_log.h"
#include "server/jobs/job_metrics.h"
#include "server/jobs/retention_clock.h"
#include "server/jobs/shared_partial_uploads.h"
#include "server/logging/log.h"
#include "server/machine/machine.h"
#include "server/machine/process_memory.h"
#include "server/machine/process_name.h"
#include "server/machine/thread_pool.h"
#include "server/metrics/prometheus_metrics.h"
#include "server/observation.h"
#include "server/rpc/accept_loop.h"
#include "server/rpc/call_interceptor.h"
#include "server/rpc/channel_arguments.h"
#include "server/rpc/correspondence_service.h"
#include "server/rpc/grpc_plugins.h"
#include "server/rpc/security/access.h"
#include "server/rpc/security/api_keys.h"
#include "server/rpc/security/server_credentials.h"
#include "server/stores.h"

namespace isomatch {
namespace {

/// What health probes get to hear NOT_SERVING: calls that come once gRPC shuts
/// down hear nothing until streams end.
constexpr absl::Duration kLastProbes = absl::Milliseconds(100);

/// What clients get to ask for the results of jobs that ended while draining,
/// and gRPC to end streams then. Together below the second that main.cc allows.
constexpr absl::Duration kLastCalls = absl::Milliseconds(300);
constexpr absl::Duration kStreamsEnd = absl::Milliseconds(300);

/// What the process itself has, and memory that was freed but not given back.
constexpr std::int64_t kProcessBytes = std::int64_t{256} << 20;

/// One for each loop of ClusterMember.
constexpr int kClusterThreads = 5;

/// One more than a tenant may use.
constexpr int kDiskThreads = 2;

/// Calls of a tenant that wait for the same threads. Most hold some KiB each,
/// FindMissingMeshes up to 200.
constexpr int kWaitingCalls = 512;
constexpr TenantTurns::Limits kOneAtATime = {.max_waiting_per_tenant =
                                                 kWaitingCalls};

/// Threads that read jobs of a database, of which a tenant may use all but one.
constexpr int kReadThreads = 8;
constexpr TenantTurns::Limits kReadsOfTenant = {
    .max_running_per_tenant = kReadThreads - 1,
    .max_waiting_per_tenant = kWaitingCalls};

std::string RandomId() {
  std::string bytes(16, '\0');
  RAND_bytes(reinterpret_cast<unsigned char*>(bytes.data()),
             static_cast<int>(bytes.size()));
  return absl::BytesToHexString(bytes);
}

/// Returns what logs that files have changed.
std::function<void(const absl::Status&)> ReloadLogger(const char* what) {
  return [what](const absl::Status& status) {
    if (status.ok()) {
      Log(LogLevel::kInfo, absl::StrCat(what, ": reloaded"));
    } else {
      Log(LogLevel::kError,
          absl::StrCat(what, ": not reloaded, the earlier ones stay in force: ",
                       status.message()));
    }
  };
}

/// Null when the configuration asks for no keys.
absl::StatusOr<std::unique_ptr<ApiKeys>> OpenKeys(const ServerConfig& config) {
  if (config.api_keys.empty()) return nullptr;
  return ApiKeys::Open(config.api_keys, absl::Now, ReloadLogger("API keys"),
                       config.max_priority);
}

/// Null when there is to be no endpoint.
std::unique_ptr<PrometheusMetrics> MakeMetrics(const ServerConfig& config) {
  if (!config.is_service() || config.metrics_listen == "off") return nullptr;
  return std::make_unique<PrometheusMetrics>(kVersion, config.is_shared());
}

}  // namespace

class Server::Impl {
 public:
  Impl(const ServerConfig& config, MatchEngine engine,
       std::unique_ptr<ApiKeys> keys, Stores stores, OnGiveUp on_give_up);
  ~Impl();

  absl::Status Listen();
  void Shutdown(absl::Duration drain);

  std::string address() const {
    return accept_loop_ == nullptr ? "" : accept_loop_->address();
  }
  std::string metrics_address() const {
    return prometheus_ == nullptr ? "" : prometheus_->address();
  }
  std::string process_name() const { return process_name_; }
  const MemoryBudget& budget() const { return budget_; }
  int threads_per_job() const { return context_.parse.threads_per_job; }
  const RequestLimits& limits() const { return context_.parse.limits; }
  JobLoad load() const { return manager_.local_load(); }
  const ConnectionLimits& connection_limits() const {
    return plan_.connections;
  }
  std::shared_ptr<grpc::Channel> InProcessChannel() {
    return grpc_->InProcessChannel(grpc::ChannelArguments());
  }

 private:
  JobLimits MakeJobLimits() const;
  JobEnvironment MakeJobEnvironment();
  ServiceContext MakeContext();
  absl::Status OpenPort(grpc::ServerBuilder& builder);
  void HandOver(int socket);
  void OnState(const JobRecord& job);
  MemoryFigures ReadMemory() const;
  LoadFigures ReadLoad();
  std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>
  MakeInterceptors();

  const ServerConfig config_;
  const ResourcePlan plan_;
  const Access access_;
  const std::unique_ptr<PrometheusMetrics> prometheus_;
  Metrics& metrics_;
  const Stores stores_;
  const OnGiveUp on_give_up_;
  const std::string process_name_ = ProcessName(RandomId());
  PreparedCache prepared_;
  MemoryBudget budget_;
  MemoryBudget request_bytes_;
  TenantBudgets requests_;
  MemoryBudget upload_bytes_;
  TenantBudgets uploads_;
  MemoryBudget download_bytes_;
  TenantBudgets downloads_;
  /// Counts calls, not bytes.
  MemoryBudget all_upload_calls_{std::numeric_limits<std::int64_t>::max()};
  TenantBudgets upload_calls_;
  const JobRunner runner_;
  RetentionClock retention_clock_;
  // Joined in ~Impl, in the reverse order of who calls whom.
  std::unique_ptr<ThreadPool> workers_;
  std::unique_ptr<ThreadPool> timers_;
  std::unique_ptr<ThreadPool> intake_;
  TenantTurns intake_turns_;
  std::unique_ptr<ThreadPool> upkeep_;
  std::unique_ptr<ThreadPool> changes_;
  TenantTurns change_turns_;
  std::unique_ptr<ThreadPool> disk_;
  TenantTurns disk_turns_;
  std::unique_ptr<ThreadPool> watch_;
  // Null without a store that others share.
  std::unique_ptr<ThreadPool> cluster_;
  std::unique_ptr<ThreadPool> reads_;
  TenantTurns read_turns_;
  const std::unique_ptr<PartialUploads> partial_uploads_;
  JobManager manager_;
  const ServiceContext context_;
  CorrespondenceService service_;
  std::once_flag shutdown_;
  PortCredentials port_credentials_;
  std::unique_ptr<grpc::experimental::ExternalConnectionAcceptor> acceptor_;
  /// Null without a port.
  std::unique_ptr<AcceptLoop> accept_loop_;
  std::unique_ptr<grpc::Server> grpc_;
};

Server::Impl::Impl(const ServerConfig& config, MatchEngine engine,
                   std::unique_ptr<ApiKeys> keys, Stores stores,
                   OnGiveUp on_give_up)
    : config_(config),
      plan_(PlanResources(config, ThisMachine())),
      access_(std::move(keys)),
      prometheus_(MakeMetrics(config)),
      metrics_(prometheus_ == nullptr ? NullMetrics() : *prometheus_),
      stores_(std::move(stores)),
      on_give_up_(std::move(on_give_up)),
      prepared_(plan_.prepared_bytes, stores_.prepared.get()),
      budget_(plan_.job_bytes),
      request_bytes_(plan_.request_bytes),
      requests_(&request_bytes_, plan_.tenant.request_bytes),
      upload_bytes_(plan_.upload_bytes),
      uploads_(&upload_bytes_, plan_.tenant.upload_bytes),
      download_bytes_(plan_.download_bytes),
      downloads_(&download_bytes_, plan_.tenant.download_bytes),
      upload_calls_(&all_upload_calls_, plan_.tenant.uploads),
      runner_(std::move(engine), DescribeResult, absl::Now, prepared_),
      retention_clock_(MakeClockEnvironment(config), stores_.last_seen),
      workers_(std::make_unique<ThreadPool>(config.workers)),
      timers_(std::make_unique<ThreadPool>(1)),
      intake_(std::make_unique<ThreadPool>(plan_.intake_threads)),
      intake_turns_({.max_waiting_per_tenant = plan_.tenant.requests},
                    intake_.get()),
      upkeep_(std::make_unique<ThreadPool>(1)),
      changes_(std::make_unique<ThreadPool>(kDiskThreads)),
      change_turns_(kOneAtATime, changes_.get()),
      disk_(std::make_unique<ThreadPool>(kDiskThreads)),
      disk_turns_(kOneAtATime, disk_.get()),
      watch_(std::make_unique<ThreadPool>(1)),
      cluster_(stores_.shared == nullptr
                   ? nullptr
                   : std::make_unique<ThreadPool>(kClusterThreads)),
      reads_(stores_.shared == nullptr
                 ? nullptr
                 : std::make_unique<ThreadPool>(kReadThreads)),
      read_turns_(kReadsOfTenant, reads_.get()),
      partial_uploads_(MakePartialUploads(stores_.uploads.get(), &uploads_,
                                          timers_.get(),
                                          config.partial_upload_kept)),
      manager_(MakeJobEnvironment()),
      context_(MakeContext()),
      service_(context_) {}

Server::Impl::~Impl() {
  Shutdown(absl::ZeroDuration());
  if (prometheus_ != nullptr) prometheus_->Close();
  partial_uploads_->Clear();
  cluster_.reset();
  intake_.reset();
  changes_.reset();
  reads_.reset();
  disk_.reset();
  upkeep_.reset();
  watch_.reset();
  workers_.reset();
  timers_.reset();
}

JobLimits Server::Impl::MakeJobLimits() const {
  JobLimits limits;
  limits.workers = config_.runs_jobs() ? config_.workers : 0;
  limits.max_queued_jobs = config_.max_queued_jobs;
  limits.tenant = plan_.tenant;
  limits.max_kept_jobs = config_.max_kept_jobs;
  limits.job_retention = config_.job_retention;
  limits.durable = config_.is_durable();
  limits.max_result_bytes = plan_.max_result_bytes;
  limits.unwatched_grace = config_.unwatched_grace;
  limits.unresponsive_grace = config_.unresponsive_grace;
  if (config_.max_run_time > absl::ZeroDuration()) {
    limits.max_run_time = config_.max_run_time;
  }
  return limits;
}

JobEnvironment Server::Impl::MakeJobEnvironment() {
  const bool logs = config_.is_service();
  JobEnvironment environment;
  environment.limits = MakeJobLimits();
  environment.jobs = stores_.jobs.get();
  environment.shared = stores_.shared;
  environment.cluster = cluster_.get();
  environment.process = process_name_;
  environment.lease = config_.lease;
  environment.blobs = stores_.blobs.get();
  environment.broken_uploads = stores_.uploads.get();
  environment.budget = &budget_;
  environment.threads_per_job = plan_.threads_per_job;
  environment.runner = &runner_;
  environment.load_spec = [this](const JobRecord& record) {
    return LoadJobSpec(record, context_.parse);
  };
  environment.workers = workers_.get();
  environment.timers = timers_.get();
  environment.disk = upkeep_.get();
  environment.watch = watch_.get();
  environment.metrics = &metrics_;
  environment.now = absl::Now;
  // The clock of a store that others share is the database's.
  if (stores_.shared == nullptr) {
    environment.retention_clock = &retention_clock_;
  }
  environment.new_id = RandomId;
  environment.read_memory = [this] { return ReadMemory(); };
  environment.traces = stores_.traces.get();
  environment.on_state = [this](const JobRecord& job) { OnState(job); };
  if (logs) environment.on_storage = LogStorage;
  if (logs) environment.on_database = LogDatabase;
  if (logs) environment.on_lease_lost = LogLeaseLost;
  if (logs) environment.on_stuck = LogStuck;
  environment.on_give_up = on_give_up_;
  return environment;
}

void Server::Impl::OnState(const JobRecord& job) {
  CountState(job, metrics_);
  if (config_.is_service()) LogState(job, absl::Now());
}

MemoryFigures Server::Impl::ReadMemory() const {
  const std::int64_t reserved =
      budget_.reserved_bytes() + prepared_.size_bytes() +
      request_bytes_.reserved_bytes() + upload_bytes_.reserved_bytes() +
      download_bytes_.reserved_bytes();
  return {.resident_bytes = ResidentBytes(),
          .expected_bytes =
              kProcessBytes + static_cast<std::int64_t>(kGrpcBytes) + reserved,
          .limit_bytes = plan_.max_resident_bytes};
}

LoadFigures Server::Impl::ReadLoad() {
  LoadFigures figures = FiguresOf(manager_);
  const PreparedCache::Counts prepared = prepared_.counts();
  figures.memory_budget_bytes = budget_.total_bytes();
  figures.memory_reserved_bytes = budget_.reserved_bytes();
  figures.memory_measured_bytes = PeakResidentBytes();
  figures.prepared_bytes = prepared_.size_bytes();
  figures.prepared_in_memory = prepared.in_memory;
  figures.prepared_on_disk = prepared.on_disk;
  figures.prepared_missing = prepared.missing;
  // A scrape waits for no database.
  if (!figures.cluster) figures.stored_bytes = stores_.blobs->size_bytes();
  if (accept_loop_ != nullptr) {
    figures.connections = accept_loop_->CountOpen();
    figures.refused_connections = accept_loop_->refused();
  }
  return figures;
}

std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>
Server::Impl::MakeInterceptors() {
  return MakeCallInterceptors({.metrics = &metrics_,
                               .log = config_.is_service(),
                               .now = absl::Now,
                               .new_id = RandomId});
}

ServiceContext Server::Impl::MakeContext() {
  ServiceContext context;
  context.access = &access_;
  context.manager = &manager_;
  context.blobs = stores_.blobs.get();
  context.budget = &budget_;
  context.requests = &requests_;
  context.partial_uploads = partial_uploads_.get();
  context.uploads = &upload_calls_;
  context.intake = &intake_turns_;
  context.changes = &change_turns_;
  if (reads_ != nullptr) context.reads = &read_turns_;
  context.disk = &disk_turns_;
  context.downloads = &downloads_;
  context.metrics = &metrics_;
  context.parse = {stores_.blobs.get(), &runner_, plan_.requests,
                   plan_.threads_per_job};
  if (!config_.runs_jobs()) {
    context.parse.threads_elsewhere = [this] {
      return manager_.workers().threads;
    };
  }
  context.durable = config_.is_durable();
  context.job_retention = config_.job_retention;
  context.max_run_time = config_.max_run_time;
  context.watch_heartbeat = config_.watch_heartbeat;
  context.upload_idle_timeout = config_.upload_idle_timeout;
  return context;
}

absl::Status Server::Impl::OpenPort(grpc::ServerBuilder& builder) {
  using Type = grpc::ServerBuilder::experimental_type::ExternalConnectionType;
  ISOMATCH_ASSIGN_OR_RETURN(
      port_credentials_, MakePortCredentials({config_.tls_cert, config_.tls_key,
                                              config_.tls_client_ca},
                                             ReloadLogger("certificates")));
  ISOMATCH_ASSIGN_OR_RETURN(
      accept_loop_, AcceptLoop::Listen(config_.listen, plan_.connections));
  acceptor_ = builder.experimental().AddExternalConnectionAcceptor(
      Type::FROM_FD, port_credentials_.credentials);
  return absl::OkStatus();
}

void Server::Impl::HandOver(int socket) {
  grpc::experimental::ExternalConnectionAcceptor::NewConnectionParameters made;
  made.fd = socket;
  acceptor_->HandleNewConnection(&made);
}

absl::Status Server::Impl::Listen() {
  manager_.Begin();
  InitGrpcPlugins();
  grpc::ServerBuilder builder;
  SetChannelArguments(context_.parse.limits, builder);
  if (!config_.listen.empty()) {
    ISOMATCH_RETURN_IF_ERROR(OpenPort(builder));
  }
  builder.RegisterService(&service_);
  if (config_.no_reflection) TakeReflection(builder);
  std::vector<
      std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>>
      interceptors;
  interceptors.push_back(MakeInterceptors());
  builder.experimental().SetInterceptorCreators(std::move(interceptors));
  grpc_ = builder.BuildAndStart();
  if (grpc_ == nullptr) return absl::InternalError("gRPC does not start");
  grpc_->GetHealthCheckService()->SetServingStatus(
      v1::CorrespondenceService::service_full_name(), true);
  if (accept_loop_ != nullptr) {
    accept_loop_->Start([this](int socket) { HandOver(socket); });
  }
  if (prometheus_ == nullptr) return absl::OkStatus();
  return prometheus_->Listen(
      config_.metrics_listen, [this] { return ReadLoad(); },
      ProbesOf(manager_));
}

void Server::Impl::Shutdown(absl::Duration drain) {
  std::call_once(shutdown_, [&] {
    if (grpc_ != nullptr) {
      grpc_->GetHealthCheckService()->SetServingStatus(false);
    }
    const bool jobs_run = manager_.local_load().running_jobs > 0;
    manager_.Shutdown(drain);
    if (drain > absl::ZeroDuration()) {
      absl::SleepFor(jobs_run ? kLastCalls : kLastProbes);
    }
    // What gRPC is given once it shuts down would stay open.
    if (accept_loop_ != nullptr) accept_loop_->Stop();
    if (grpc_ != nullptr) {
      grpc_->Shutdown(absl::ToChronoTime(absl::Now() + kStreamsEnd));
    }
  });
}

absl::StatusOr<std::unique_ptr<Server>> Server::Create(
    const ServerConfig& config) {
  return Create(config, CoreMatchEngine());
}

absl::StatusOr<std::unique_ptr<Server>> Server::Create(
    const ServerConfig& config, MatchEngine engine, OnGiveUp on_give_up) {
  return Create(config, std::move(engine), std::move(on_give_up), OpenStores);
}

absl::StatusOr<std::unique_ptr<Server>> Server::Create(
    const ServerConfig& config, MatchEngine engine, OnGiveUp on_give_up,
    const StoreOpener& open) {
  ISOMATCH_RETURN_IF_ERROR(config.Validate());
  ISOMATCH_ASSIGN_OR_RETURN(std::unique_ptr<ApiKeys> keys, OpenKeys(config));
  ISOMATCH_ASSIGN_OR_RETURN(Stores stores, open(config));
  auto impl = std::make_unique<Impl>(config, std::move(engine), std::move(keys),
                                     std::move(stores), std::move(on_give_up));
  ISOMATCH_RETURN_IF_ERROR(impl->Listen());
  return std::unique_ptr<Server>(new Server(std::move(impl)));
}

Server::Server(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Server::~Server() = default;

std::string Server::address() const { return impl_->address(); }
std::string Server::metrics_address() const { return impl_->metrics_address(); }
std::string Server::process_name() const { return impl_->process_name(); }
int Server::threads_per_job() const { return impl_->threads_per_job(); }
const RequestLimits& Server::limits() const { return impl_->limits(); }
const ConnectionLimits& Server::connection_limits() const {
  return impl_->connection_limits();
}
std::int64_t Server::memory_budget_bytes() const {
  return impl_->budget().total_bytes();
}

int Server::running_jobs() const { return impl_->load().running_jobs; }
int Server::stuck_workers() const { return impl_->load().stuck_jobs; }

std::shared_ptr<grpc::Channel> Server::InProcessChannel() {
  return impl_->InProcessChannel();
}

void Server::Shutdown(absl::Duration drain) { impl_->Shutdown(drain); }

}  // namespace isomatch
