#include "server/metrics/prometheus_metrics.h"

#include <cstdint>
#include <exception>
#include <optional>
#include <utility>
#include <vector>

#include <prometheus/collectable.h>
#include <prometheus/counter.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>

#include "absl/strings/str_cat.h"
#include "server/metrics/metrics_endpoint.h"

namespace isomatch {
namespace {

using prometheus::Counter;
using prometheus::Family;
using prometheus::Histogram;
using prometheus::MetricFamily;
using prometheus::Registry;
using Buckets = Histogram::BucketBoundaries;

/// Seconds, from a job of two tiny meshes to one of hours.
const Buckets& JobBuckets() {
  static const Buckets buckets = {0.01, 0.05, 0.1, 0.5, 1,   2,    5,    10,
                                  20,   60,   120, 300, 600, 1800, 3600, 14400};
  return buckets;
}

/// Seconds, from GetJob to a WatchJob of a long job.
const Buckets& CallBuckets() {
  static const Buckets buckets = {0.0005, 0.001, 0.005, 0.01, 0.05, 0.1,
                                  0.5,    1,     5,     30,   300,  3600};
  return buckets;
}

/// Seconds, from a claim of a queue of no jobs to one that hardly works.
const Buckets& ClaimBuckets() {
  static const Buckets buckets = {0.001, 0.0025, 0.005, 0.01, 0.025, 0.05,
                                  0.1,   0.25,   0.5,   1,    2.5,   5};
  return buckets;
}

/// Below 1 the estimate was too low.
const Buckets& RatioBuckets() {
  static const Buckets buckets = {0.5, 0.8, 1, 1.25, 1.5, 2, 3, 5, 10};
  return buckets;
}

using prometheus::MetricType;

/// A value of a family, and the label that tells it from the others.
struct Labeled {
  std::string label;
  double value;
};

/// What one type of metric tells by the values of the label `by`.
MetricFamily MakeFamily(MetricType type, const std::string& name,
                        const std::string& help, const std::string& by,
                        const std::vector<Labeled>& values) {
  MetricFamily family;
  family.name = absl::StrCat("isomatch_", name);
  family.help = help;
  family.type = type;
  for (const auto& [label, value] : values) {
    prometheus::ClientMetric& metric = family.metric.emplace_back();
    if (!by.empty()) metric.label = {{by, label}};
    // Of these the type says which is read.
    metric.gauge.value = value;
    metric.counter.value = value;
  }
  return family;
}

MetricFamily MakeGauge(const std::string& name, const std::string& help,
                       double value) {
  return MakeFamily(MetricType::Gauge, name, help, "", {{"", value}});
}

MetricFamily MakeTotal(const std::string& name, const std::string& help,
                       double value) {
  return MakeFamily(MetricType::Counter, name, help, "", {{"", value}});
}

void AddGauges(const ClusterFigures::Told& told,
               std::vector<MetricFamily>& families) {
  const auto add = [&](const std::string& name, const std::string& help,
                       double value) {
    families.push_back(MakeGauge(name, help, value));
  };
  add("cluster_jobs_queued", "Jobs that wait, of all processes",
      told.queued_jobs);
  add("cluster_jobs_running", "Jobs that have a worker, of all processes",
      told.running_jobs);
  add("queue_oldest_seconds", "How long ago the oldest waiting job was created",
      absl::ToDoubleSeconds(told.oldest_queued));
  add("workers_registered", "Processes that take jobs", told.workers);
  add("database_live_rows", "Jobs that are not over, as PostgreSQL estimates",
      static_cast<double>(told.live_rows));
  add("database_dead_rows",
      "Old versions of these, not vacuumed yet, as PostgreSQL estimates",
      static_cast<double>(told.dead_rows));
  add("database_table_bytes", "Table of these, with its indexes",
      static_cast<double>(told.table_bytes));
  add("database_oldest_transaction_seconds",
      "What a transaction that is still open may see cannot be vacuumed",
      absl::ToDoubleSeconds(told.oldest_transaction));
}

void AddFigures(const ClusterFigures& cluster,
                std::vector<MetricFamily>& families) {
  families.push_back(MakeGauge("database_up",
                               "1 if it answered when it was asked last, or 0",
                               cluster.is_database_up ? 1 : 0));
  families.push_back(
      MakeTotal("database_errors_total",
                "Calls of this process that the database refused or did not "
                "answer",
                static_cast<double>(cluster.database_errors)));
  if (cluster.told) AddGauges(*cluster.told, families);
}

/// Gauges that are read when Prometheus asks.
class LoadCollector final : public prometheus::Collectable {
 public:
  explicit LoadCollector(PrometheusMetrics::ReadLoad read_load)
      : read_load_(std::move(read_load)) {}

  std::vector<MetricFamily> Collect() const override {
    const LoadFigures load = read_load_();
    std::vector<MetricFamily> families = Local(load);
    if (load.cluster) AddFigures(*load.cluster, families);
    return families;
  }

 private:
  static std::vector<MetricFamily> Local(const LoadFigures& load) {
    const auto count = [](std::int64_t number) {
      return static_cast<double>(number);
    };
    return {
        // Few labels, however many priorities there are.
        MakeFamily(MetricType::Gauge, "jobs_queued",
                   "Jobs that wait, by priority below, at and above 0",
                   "priority",
                   {{"low", count(load.queued_low)},
                    {"normal", count(load.queued_normal)},
                    {"high", count(load.queued_high)}}),
        // They cannot start although it may be their turn.
        MakeFamily(
            MetricType::Gauge, "jobs_held",
            "Jobs of the queue that wait for the disk, by what it refuses",
            "reason",
            {{"storage", count(load.held_for_storage)},
             {"inputs", count(load.held_for_inputs)}}),
        MakeGauge("jobs_running", "Jobs that have a worker", load.running_jobs),
        MakeGauge("workers_stuck",
                  "Workers whose jobs were asked to stop and do not",
                  load.stuck_workers),
        MakeGauge("watchers", "WatchJob streams that are open", load.watchers),
        MakeGauge("connections", "Connections that are open", load.connections),
        MakeTotal("connections_refused_total",
                  "Connections that were closed at once",
                  static_cast<double>(load.refused_connections)),
        MakeGauge("memory_budget_bytes",
                  "What running jobs may reserve together",
                  count(load.memory_budget_bytes)),
        MakeGauge("memory_reserved_bytes", "What running jobs have reserved",
                  count(load.memory_reserved_bytes)),
        MakeGauge("memory_measured_bytes",
                  "Peak resident memory since a job last started",
                  count(load.memory_measured_bytes)),
        MakeGauge("stored_bytes", "Meshes and results that are kept",
                  count(load.stored_bytes)),
        MakeGauge("prepared_bytes", "Prepared meshes in memory",
                  count(load.prepared_bytes)),
        MakeFamily(
            MetricType::Counter, "prepared_total",
            "Meshes that jobs needed, by where their preparation was found",
            "found",
            {{"memory", count(load.prepared_in_memory)},
             {"disk", count(load.prepared_on_disk)},
             {"none", count(load.prepared_missing)}}),
    };
  }

  const PrometheusMetrics::ReadLoad read_load_;
};

}  // namespace

class PrometheusMetrics::Impl {
 public:
  Family<Counter>& AddCounter(const std::string& name,
                              const std::string& help) {
    return prometheus::BuildCounter()
        .Name(absl::StrCat("isomatch_", name))
        .Help(help)
        .Register(*registry);
  }

  Family<Histogram>& AddHistogram(const std::string& name,
                                  const std::string& help) {
    return prometheus::BuildHistogram()
        .Name(absl::StrCat("isomatch_", name))
        .Help(help)
        .Register(*registry);
  }

  const std::shared_ptr<Registry> registry = std::make_shared<Registry>();
  Family<Counter>& jobs = AddCounter("jobs_total", "Jobs that became terminal");
  Histogram& queue_wait =
      AddHistogram("queue_wait_seconds", "From CreateJob to a worker")
          .Add({}, JobBuckets());
  Family<Histogram>& run =
      AddHistogram("job_seconds", "How long terminal jobs had a worker");
  Family<Histogram>& stage =
      AddHistogram("run_seconds", "Stages of jobs that succeeded");
  Histogram& estimate_ratio =
      AddHistogram("memory_estimate_error_ratio",
                   "Memory estimate of a job over the measured peak")
          .Add({}, RatioBuckets());
  Counter& upload_bytes =
      AddCounter("upload_bytes_total", "Chunks of UploadMesh").Add({});
  Family<Counter>& handled =
      AddCounter("grpc_server_handled_total", "Calls that were answered");
  Family<Histogram>& handling =
      AddHistogram("grpc_server_handling_seconds", "From a call to its answer");

  /// Of the queue that others share.
  struct Queue {
    explicit Queue(Impl& impl)
        : claims(impl.AddCounter("claims_total", "Jobs that came to a worker")
                     .Add({})),
          claim_failures(impl.AddCounter("claim_failures_total",
                                         "Claims that the database refused or "
                                         "did not answer")
                             .Add({})),
          leases_lost(impl.AddCounter("leases_lost_total",
                                      "Jobs of this process that others took")
                          .Add({})),
          leases_expired(
              impl.AddCounter("leases_expired_total",
                              "Jobs that this process took from silent workers")
                  .Add({})),
          claim_seconds(
              impl.AddHistogram("claim_seconds", "Claims, also those of no job")
                  .Add({}, ClaimBuckets())) {}
    Counter& claims;
    Counter& claim_failures;
    Counter& leases_lost;
    Counter& leases_expired;
    Histogram& claim_seconds;
  };
  std::optional<Queue> queue;

  // All of these only while it listens.
  Probes probes;
  std::shared_ptr<prometheus::Collectable> load;
  std::string address;
  std::unique_ptr<prometheus::Exposer> exposer;
};

PrometheusMetrics::PrometheusMetrics(const std::string& version, bool is_shared)
    : impl_(std::make_unique<Impl>()) {
  if (is_shared) impl_->queue.emplace(*impl_);
  prometheus::BuildGauge()
      .Name("isomatch_build_info")
      .Help("Always 1; the label tells the version")
      .Register(*impl_->registry)
      .Add({{"version", version}})
      .Set(1);
}

PrometheusMetrics::~PrometheusMetrics() { Close(); }

absl::Status PrometheusMetrics::Listen(const std::string& address,
                                       ReadLoad read_load, Probes probes) {
  impl_->probes = std::move(probes);
  try {
    impl_->exposer = OpenEndpoint(address, impl_->probes);
  } catch (const std::exception&) {  // it says no more than that it failed
    return absl::UnavailableError(
        absl::StrCat("cannot listen on ", address,
                     " for metrics: is the port in use, or the address not of "
                     "this machine? --metrics-listen off does without"));
  }
  const int port = impl_->exposer->GetListeningPorts().front();
  impl_->address =
      absl::StrCat(address.substr(0, address.rfind(':')), ":", port);
  impl_->load = std::make_shared<LoadCollector>(std::move(read_load));
  impl_->exposer->RegisterCollectable(impl_->registry);
  impl_->exposer->RegisterCollectable(impl_->load);
  return absl::OkStatus();
}

std::string PrometheusMetrics::address() const { return impl_->address; }

void PrometheusMetrics::Close() {
  if (impl_->exposer == nullptr) return;
  CloseEndpoint(std::move(impl_->exposer), impl_->address);
  impl_->load.reset();
  impl_->address.clear();
}

void PrometheusMetrics::JobStarted(absl::Duration waited) {
  impl_->queue_wait.Observe(absl::ToDoubleSeconds(waited));
}

void PrometheusMetrics::JobEnded(const std::string& state,
                                 const std::string& reason) {
  impl_->jobs.Add({{"state", state}, {"reason", reason}}).Increment();
}

void PrometheusMetrics::JobRan(const std::string& state, absl::Duration ran) {
  impl_->run.Add({{"state", state}}, JobBuckets())
      .Observe(absl::ToDoubleSeconds(ran));
}

void PrometheusMetrics::StageRan(const std::string& stage, absl::Duration ran) {
  impl_->stage.Add({{"stage", stage}}, JobBuckets())
      .Observe(absl::ToDoubleSeconds(ran));
}

void PrometheusMetrics::JobMeasured(double estimate_ratio) {
  impl_->estimate_ratio.Observe(estimate_ratio);
}

void PrometheusMetrics::Uploaded(std::int64_t bytes) {
  impl_->upload_bytes.Increment(static_cast<double>(bytes));
}

void PrometheusMetrics::Claimed(int jobs, absl::Duration took) {
  if (!impl_->queue) return;
  impl_->queue->claims.Increment(jobs);
  impl_->queue->claim_seconds.Observe(absl::ToDoubleSeconds(took));
}

void PrometheusMetrics::ClaimFailed() {
  if (impl_->queue) impl_->queue->claim_failures.Increment();
}

void PrometheusMetrics::LeaseLost() {
  if (impl_->queue) impl_->queue->leases_lost.Increment();
}

void PrometheusMetrics::LeaseExpired() {
  if (impl_->queue) impl_->queue->leases_expired.Increment();
}

void PrometheusMetrics::CallHandled(const std::string& method,
                                    const std::string& code,
                                    absl::Duration handled) {
  impl_->handled.Add({{"method", method}, {"code", code}}).Increment();
  impl_->handling.Add({{"method", method}}, CallBuckets())
      .Observe(absl::ToDoubleSeconds(handled));
}

}  // namespace isomatch
