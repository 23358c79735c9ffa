#include "tests/bench/queue_bench.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

#include <unistd.h>
#include <nlohmann/json.hpp>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/time/clock.h"
#include "client/files/text_file.h"
#include "client/sample/sample_animal.h"
#include "core/base/status_macros.h"
#include "core/io/draco_mesh.h"
#include "isomatch/v1/service.grpc.pb.h"
#include "server/logging/log.h"
#include "server/postgres/migrations.h"
#include "server/postgres/postgres_job_store.h"
#include "server/server.h"
#include "server/shared_stores.h"
#include "tests/bench/worker_networks.h"
#include "tests/support/postgres_server.h"

namespace isomatch::bench {
namespace {

/// In a second.
constexpr double kMillisecond = 1e3;
constexpr int kTenants = 5;
/// Workers that jobs pass through while the table is watched.
constexpr int kPassWorkers = 4;

double SecondsSince(absl::Time begin) {
  return absl::ToDoubleSeconds(absl::Now() - begin);
}

/// Processor seconds of a process and its living and dead children; PostgreSQL
/// has one for each connection.
double ProcessorSeconds(pid_t postmaster) {
  double ticks = 0;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    std::ifstream file(entry.path() / "stat");
    std::string text;
    if (!std::getline(file, text)) continue;
    const std::vector<std::string> fields =
        absl::StrSplit(text.substr(text.rfind(')') + 2), ' ');
    int parent = 0;
    if (fields.size() < 15 || !absl::SimpleAtoi(fields[1], &parent)) continue;
    const bool is_it = entry.path().filename() == absl::StrCat(postmaster);
    if (!is_it && parent != postmaster) continue;
    // utime and stime, and those of children that were waited for.
    for (const size_t field : {11u, 12u, 13u, 14u}) {
      double value = 0;
      if (absl::SimpleAtod(fields[field], &value)) ticks += value;
    }
  }
  return ticks / static_cast<double>(sysconf(_SC_CLK_TCK));
}

class Queue {
 public:
  static absl::StatusOr<std::unique_ptr<Queue>> Open(
      const QueueSelection& selection, int workers) {
    auto queue = std::make_unique<Queue>();
    PostgresServer::Options options = {.fsync = selection.fsync};
    if (selection.namespaces) {
      ISOMATCH_ASSIGN_OR_RETURN(queue->networks_,
                                WorkerNetworks::Make(workers));
      options.address = WorkerNetworks::kAddress;
      options.network = WorkerNetworks::kNetwork;
    }
    ISOMATCH_ASSIGN_OR_RETURN(queue->server_, PostgresServer::Start(options));
    ISOMATCH_ASSIGN_OR_RETURN(
        queue->pool_, PostgresPool::Open({.url = queue->server_->url(),
                                          .connections = workers + 4,
                                          .patience = absl::Seconds(30)}));
    ISOMATCH_RETURN_IF_ERROR(Migrate(*queue->pool_).status());
    // As server/README asks for.
    for (const char* setting : {"ALTER SYSTEM SET autovacuum_naptime = '5s'",
                                "SELECT pg_reload_conf()"}) {
      ISOMATCH_RETURN_IF_ERROR(
          queue->pool_->Ask(PostgresPool::Repeat::kOnce, setting).status());
    }
    queue->store_ = std::make_unique<PostgresJobStore>(
        queue->pool_.get(), PostgresJobStore::Options());
    return queue;
  }

  PostgresJobStore& store() { return *store_; }
  std::string url() const { return server_->url(); }
  double processor_seconds() const { return ProcessorSeconds(server_->id()); }

  /// A store that a worker, this thread, has to itself.
  absl::StatusOr<std::unique_ptr<PostgresPool>> OpenForWorker(
      int worker) const {
    if (networks_ != nullptr) {
      ISOMATCH_RETURN_IF_ERROR(networks_->Enter(worker));
    }
    return PostgresPool::Open(
        {.url = networks_ != nullptr ? server_->tcp_url() : server_->url(),
         .connections = 1,
         .patience = absl::Seconds(30)});
  }

  absl::Status Insert(int count) {
    for (int i = 0; i < count; ++i) {
      JobRecord job;
      job.id = absl::StrCat("bench-", ++last_);
      job.tenant = absl::StrCat("tenant-", last_ % kTenants);
      job.memory_estimate_bytes = 1;
      ISOMATCH_RETURN_IF_ERROR(store_->Insert(std::move(job)).status());
    }
    return absl::OkStatus();
  }

  /// Claims a job, holds it, and ends it as its worker does; false when there
  /// is none.
  static absl::StatusOr<bool> Work(PostgresJobStore& store,
                                   const std::string& worker, double seconds) {
    ClaimRequest request;
    request.worker = worker;
    request.free_bytes = request.total_bytes = 1 << 30;
    request.max_running_per_tenant = 1 << 20;
    ISOMATCH_ASSIGN_OR_RETURN(std::optional<JobRecord> job,
                              store.Claim(request));
    if (!job) return false;
    if (seconds > 0) absl::SleepFor(absl::Seconds(seconds));
    job->state = JobState::kFailed;
    job->error = {absl::StatusCode::kInternal, "BENCH", "no job at all"};
    ISOMATCH_RETURN_IF_ERROR(store.Update(*std::move(job)).status());
    return true;
  }

  absl::StatusOr<std::int64_t> TableBytes() {
    ISOMATCH_ASSIGN_OR_RETURN(
        const pqxx::result rows,
        pool_->Ask(PostgresPool::Repeat::kOnce,
                   "SELECT pg_total_relation_size('isomatch.live_jobs')"));
    return rows[0][0].as<std::int64_t>();
  }

  absl::Status Forget() {
    return pool_
        ->Ask(PostgresPool::Repeat::kOnce,
              "TRUNCATE isomatch.jobs, isomatch.live_jobs, isomatch.job_blobs")
        .status();
  }

 private:
  std::unique_ptr<WorkerNetworks> networks_;
  std::unique_ptr<PostgresServer> server_;
  std::unique_ptr<PostgresPool> pool_;
  std::unique_ptr<PostgresJobStore> store_;
  std::int64_t last_ = 0;
};

/// Works until there is no job, or `may_go_on()` is false.
absl::Status WorkOn(const Queue& queue, int worker, double job_seconds,
                    const std::function<bool()>& may_go_on) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::unique_ptr<PostgresPool> pool,
                            queue.OpenForWorker(worker));
  PostgresJobStore store(pool.get(), PostgresJobStore::Options());
  const std::string name = absl::StrCat("worker-", worker);
  while (may_go_on()) {
    ISOMATCH_ASSIGN_OR_RETURN(const bool has_worked,
                              Queue::Work(store, name, job_seconds));
    if (!has_worked) return absl::NotFoundError("no job");
  }
  return absl::OkStatus();
}

/// Calls `work(worker)` in a thread of each; what went wrong.
absl::Status WithWorkers(int workers,
                         const std::function<absl::Status(int)>& work) {
  std::mutex mutex;
  absl::Status worst;
  std::vector<std::thread> threads;
  for (int w = 0; w < workers; ++w) {
    threads.emplace_back([&, w] {
      const absl::Status ended = work(w);
      const std::lock_guard lock(mutex);
      worst.Update(ended);
    });
  }
  for (std::thread& thread : threads) thread.join();
  return worst;
}

/// Lets so many workers empty the queue.
absl::Status Empty(const Queue& queue, int workers, double job_seconds) {
  return WithWorkers(workers, [&](int worker) {
    const absl::Status ended =
        WorkOn(queue, worker, job_seconds, [] { return true; });
    return absl::IsNotFound(ended) ? absl::OkStatus() : ended;
  });
}

absl::Status MeasureClaims(Queue& queue, const QueueSelection& selection,
                           nlohmann::json& out) {
  std::printf("workers   jobs/s   database ms of processor a job\n");
  for (const int workers : selection.workers) {
    const int jobs =
        selection.job_seconds > 0
            ? std::min(selection.jobs,
                       static_cast<int>(workers * 10 / selection.job_seconds))
            : selection.jobs;
    ISOMATCH_RETURN_IF_ERROR(queue.Insert(jobs));
    const double before = queue.processor_seconds();
    const absl::Time begin = absl::Now();
    ISOMATCH_RETURN_IF_ERROR(Empty(queue, workers, selection.job_seconds));
    const double rate = jobs / SecondsSince(begin);
    const double cost =
        kMillisecond * (queue.processor_seconds() - before) / jobs;
    std::printf("%7d %8.0f %8.3f\n", workers, rate, cost);
    out["claims"].push_back({{"workers", workers},
                             {"jobs_per_second", rate},
                             {"database_milliseconds", cost}});
    ISOMATCH_RETURN_IF_ERROR(queue.Forget());
  }
  return absl::OkStatus();
}

absl::StatusOr<v1::CreateJobRequest> SmallJob() {
  constexpr int kVertices = 300;
  ISOMATCH_ASSIGN_OR_RETURN(const Sample sample,
                            MakeSample({.pose = 'A', .vertices = kVertices}));
  ISOMATCH_ASSIGN_OR_RETURN(const EncodedMesh encoded,
                            EncodeDraco(sample.mesh));
  v1::CreateJobRequest request;
  for (v1::Mesh* mesh : {request.mutable_mesh_x(), request.mutable_mesh_y()}) {
    mesh->set_draco(encoded.bytes);
    mesh->set_vertex_order(encoded.vertex_order == VertexOrder::kDecoded
                               ? v1::VERTEX_ORDER_DECODED
                               : v1::VERTEX_ORDER_ID_ATTRIBUTE);
    mesh->set_vertex_count(kVertices);
  }
  return request;
}

/// Calls of a gateway within this process.
absl::Status MeasureCreateJob(Queue& queue, const QueueSelection& selection,
                              nlohmann::json& out) {
  ISOMATCH_RETURN_IF_ERROR(queue.Insert(selection.queued));
  ServerConfig config;
  config.store = queue.url();
  config.role = "gateway";
  config.listen = "";
  config.max_queued_jobs = ServerConfig::kMaxQueuedJobs.most;
  ISOMATCH_ASSIGN_OR_RETURN(
      const std::unique_ptr<Server> gateway,
      Server::Create(config, CoreMatchEngine(), nullptr, OpenAnyStores));
  const auto stub =
      v1::CorrespondenceService::NewStub(gateway->InProcessChannel());
  ISOMATCH_ASSIGN_OR_RETURN(const v1::CreateJobRequest request, SmallJob());
  constexpr int kCalls = 1000;
  std::vector<double> milliseconds;
  for (int i = 0; i < kCalls; ++i) {
    grpc::ClientContext context;
    v1::CreateJobResponse response;
    const absl::Time begin = absl::Now();
    const grpc::Status status = stub->CreateJob(&context, request, &response);
    if (!status.ok()) return absl::InternalError(status.error_message());
    milliseconds.push_back(kMillisecond * SecondsSince(begin));
  }
  std::sort(milliseconds.begin(), milliseconds.end());
  const double median = milliseconds[kCalls / 2];
  const double p99 = milliseconds[kCalls * 99 / 100];
  std::printf(
      "CreateJob with %d jobs queued: median %.1f ms, 99th percentile %.1f "
      "ms\n",
      selection.queued, median, p99);
  out["create_job"] = {{"queued", selection.queued},
                       {"median_milliseconds", median},
                       {"p99_milliseconds", p99}};
  return queue.Forget();
}

/// As many jobs come as end, so that as many wait as before.
absl::Status Pass(Queue& queue, int jobs) {
  std::atomic<int> left = jobs;
  // The one more inserts.
  return WithWorkers(kPassWorkers + 1, [&](int worker) {
    if (worker == kPassWorkers) return queue.Insert(jobs);
    return WorkOn(queue, worker, /*job_seconds=*/0,
                  [&] { return --left >= 0; });
  });
}

absl::Status MeasureTable(Queue& queue, const QueueSelection& selection,
                          nlohmann::json& out) {
  constexpr int kWaiting = 10000;
  constexpr int kStep = 2000;
  ISOMATCH_RETURN_IF_ERROR(queue.Insert(kWaiting));
  std::int64_t most = 0;
  const absl::Time begin = absl::Now();
  for (int passed = 0; passed < selection.passing; passed += kStep) {
    ISOMATCH_RETURN_IF_ERROR(Pass(queue, kStep));
    ISOMATCH_ASSIGN_OR_RETURN(const std::int64_t bytes, queue.TableBytes());
    most = std::max(most, bytes);
    std::fprintf(stderr, "\r%d jobs, %.0f s, table %.1f MB, most %.1f MB ",
                 passed + kStep, SecondsSince(begin),
                 static_cast<double>(bytes) / 1e6,
                 static_cast<double>(most) / 1e6);
  }
  std::fprintf(stderr, "\n");
  std::printf(
      "table of live jobs with its indices: at most %.1f MB while %d jobs "
      "passed in %.0f s\n",
      static_cast<double>(most) / 1e6, selection.passing, SecondsSince(begin));
  out["table"] = {{"passed", selection.passing}, {"most_bytes", most}};
  return absl::OkStatus();
}

}  // namespace

absl::Status RunQueue(const QueueSelection& selection,
                      const std::string& out_path) {
  SetUpLog("warn", LogFormat::kText);
  const int most =
      *std::max_element(selection.workers.begin(), selection.workers.end());
  ISOMATCH_ASSIGN_OR_RETURN(
      const std::unique_ptr<Queue> queue,
      Queue::Open(selection, std::max(most, kPassWorkers)));
  nlohmann::json out;
  ISOMATCH_RETURN_IF_ERROR(MeasureClaims(*queue, selection, out));
  ISOMATCH_RETURN_IF_ERROR(MeasureCreateJob(*queue, selection, out));
  ISOMATCH_RETURN_IF_ERROR(MeasureTable(*queue, selection, out));
  if (out_path.empty()) return absl::OkStatus();
  return WriteFileAtomically(out_path, out.dump(2) + "\n");
}

}  // namespace isomatch::bench
