#include "tests/bench/service_bench.h"

#include <algorithm>
#include <cstdio>
#include <functional>
#include <thread>
#include <utility>

#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "client/files/text_file.h"
#include "client/sample/sample_animal.h"
#include "core/base/status_macros.h"
#include "core/io/draco_mesh.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/matcher.h"
#include "server/logging/log.h"
#include "tests/bench/local_service.h"
#include "tests/bench/machine.h"

namespace isomatch::bench {
namespace {

constexpr double kPercent = 100;
constexpr double kMilliseconds = 1e3;
constexpr double kSecondsAMinute = 60;
constexpr std::int64_t kCacheBytes = std::int64_t{1} << 30;

/// A mesh as it travels and as the server decodes it.
struct SentMesh {
  v1::Mesh sent;
  TriangleMesh decoded;
};

struct JobPair {
  v1::CreateJobRequest request;
  TriangleMesh mesh_x;
  TriangleMesh mesh_y;
};

/// One job, or one on each worker, through the service and without it.
struct Round {
  double service_seconds = 0;
  double direct_seconds = 0;
  std::vector<ServiceSeconds> jobs;
};

struct Throughput {
  int vertices = 0;
  int threads = 0;
  double service_seconds = 0;
  double direct_seconds = 0;
  /// Median, smallest and largest of service / direct - 1.
  double overhead = 0;
  double overhead_least = 0;
  double overhead_most = 0;
  ServiceSeconds job;
};

/// Seconds of each job of the template.
struct TemplateRun {
  std::vector<double> without_cache;
  std::vector<double> with_cache;
};

// Prints in the order of the fields.
using Part = std::pair<const char*, double ServiceSeconds::*>;
constexpr Part kParts[] = {
    {"submit", &ServiceSeconds::submit},    {"accept", &ServiceSeconds::accept},
    {"load", &ServiceSeconds::load},        {"match", &ServiceSeconds::match},
    {"store", &ServiceSeconds::store},      {"watch", &ServiceSeconds::watch},
    {"download", &ServiceSeconds::download}};

double SumOf(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum;
}

ServerConfig ConfigOf(const ServiceSelection& selection,
                      const MatchOptions& options) {
  ServerConfig config;
  config.metrics_listen = "off";
  config.workers = selection.workers;
  config.threads_per_job = options.threads;
  config.max_request_bytes = std::int64_t{256} << 20;
  return config;
}

absl::StatusOr<SentMesh> MakeMesh(char pose, int vertices, int seed) {
  ISOMATCH_ASSIGN_OR_RETURN(
      const Sample sample,
      MakeSample({.pose = pose,
                  .vertices = vertices,
                  .mesh_seed = static_cast<std::uint64_t>(seed)}));
  ISOMATCH_ASSIGN_OR_RETURN(EncodedMesh encoded, EncodeDraco(sample.mesh));
  SentMesh mesh;
  ISOMATCH_ASSIGN_OR_RETURN(
      mesh.decoded, DecodeDraco(encoded.bytes, encoded.vertex_order, vertices));
  mesh.sent.set_draco(std::move(encoded.bytes));
  mesh.sent.set_vertex_order(encoded.vertex_order == VertexOrder::kDecoded
                                 ? v1::VERTEX_ORDER_DECODED
                                 : v1::VERTEX_ORDER_ID_ATTRIBUTE);
  mesh.sent.set_vertex_count(static_cast<std::uint32_t>(vertices));
  return mesh;
}

JobPair MakeJob(const SentMesh& x, const SentMesh& y,
                const MatchOptions& options) {
  JobPair job{{}, x.decoded, y.decoded};
  *job.request.mutable_mesh_x() = x.sent;
  *job.request.mutable_mesh_y() = y.sent;
  job.request.mutable_options()->set_random_seed(options.random_seed);
  job.request.mutable_options()->set_profile(options.profile == Profile::kPaper
                                                 ? v1::PROFILE_PAPER
                                                 : v1::PROFILE_DEFAULT);
  return job;
}

/// Jobs with meshes that no other job has.
absl::StatusOr<std::vector<JobPair>> MakeJobs(int count, int vertices,
                                              int first_seed,
                                              const MatchOptions& options) {
  std::vector<JobPair> jobs;
  for (int i = 0; i < count; ++i) {
    ISOMATCH_ASSIGN_OR_RETURN(const SentMesh x,
                              MakeMesh('A', vertices, first_seed + i));
    ISOMATCH_ASSIGN_OR_RETURN(const SentMesh y,
                              MakeMesh('B', vertices, first_seed + i));
    jobs.push_back(MakeJob(x, y, options));
  }
  return jobs;
}

/// Runs body(0), ..., body(count - 1) at the same time; the first error.
absl::Status RunTogether(int count,
                         const std::function<absl::Status(int)>& body) {
  std::vector<absl::Status> statuses(static_cast<size_t>(count));
  std::vector<std::thread> threads;
  for (int i = 0; i < count; ++i) {
    threads.emplace_back(
        [&, i] { statuses[static_cast<size_t>(i)] = body(i); });
  }
  for (std::thread& thread : threads) thread.join();
  for (const absl::Status& status : statuses) {
    ISOMATCH_RETURN_IF_ERROR(status);
  }
  return absl::OkStatus();
}

absl::StatusOr<Round> MeasureRound(const LocalService& service,
                                   const std::vector<JobPair>& jobs,
                                   const MatchOptions& options,
                                   bool service_first) {
  const int count = static_cast<int>(jobs.size());
  Round round;
  std::vector<ServiceRun> runs(jobs.size());
  std::vector<VertexMap> direct(jobs.size());
  const auto run_service = [&]() -> absl::Status {
    const double begin = WallSeconds();
    ISOMATCH_RETURN_IF_ERROR(RunTogether(count, [&](int i) -> absl::Status {
      ISOMATCH_ASSIGN_OR_RETURN(runs[i], service.Run(jobs[i].request));
      return absl::OkStatus();
    }));
    round.service_seconds = WallSeconds() - begin;
    return absl::OkStatus();
  };
  const auto run_direct = [&]() -> absl::Status {
    const double begin = WallSeconds();
    ISOMATCH_RETURN_IF_ERROR(RunTogether(count, [&](int i) -> absl::Status {
      ISOMATCH_ASSIGN_OR_RETURN(
          Correspondence found,
          Match(jobs[i].mesh_x, jobs[i].mesh_y, {}, options));
      direct[i] = std::move(found.y_from_x);
      return absl::OkStatus();
    }));
    round.direct_seconds = WallSeconds() - begin;
    return absl::OkStatus();
  };
  if (service_first) ISOMATCH_RETURN_IF_ERROR(run_service());
  ISOMATCH_RETURN_IF_ERROR(run_direct());
  if (!service_first) ISOMATCH_RETURN_IF_ERROR(run_service());
  for (size_t i = 0; i < jobs.size(); ++i) {
    if (runs[i].y_from_x != direct[i]) {
      return absl::InternalError("the service found another map than Match");
    }
    round.jobs.push_back(runs[i].seconds);
  }
  return round;
}

Throughput Summarize(const std::vector<Round>& rounds) {
  Throughput result;
  std::vector<double> service, direct, overheads;
  std::vector<ServiceSeconds> jobs;
  for (const Round& round : rounds) {
    service.push_back(round.service_seconds);
    direct.push_back(round.direct_seconds);
    overheads.push_back(round.service_seconds / round.direct_seconds - 1);
    jobs.insert(jobs.end(), round.jobs.begin(), round.jobs.end());
  }
  result.service_seconds = MedianOf(service);
  result.direct_seconds = MedianOf(direct);
  result.overhead = MedianOf(overheads);
  result.overhead_least = *std::min_element(overheads.begin(), overheads.end());
  result.overhead_most = *std::max_element(overheads.begin(), overheads.end());
  for (const auto& [name, part] : kParts) {
    std::vector<double> values;
    for (const ServiceSeconds& job : jobs) values.push_back(job.*part);
    result.job.*part = MedianOf(std::move(values));
  }
  return result;
}

absl::StatusOr<Throughput> MeasureThroughput(const ServiceSelection& selection,
                                             int vertices,
                                             MatchOptions options) {
  ISOMATCH_ASSIGN_OR_RETURN(const auto service,
                            LocalService::Start(ConfigOf(selection, options)));
  options.threads = service->threads_per_job();
  std::vector<Round> rounds;
  // The first round warms up and does not count.
  for (int round = 0; round <= selection.jobs; ++round) {
    ISOMATCH_ASSIGN_OR_RETURN(const std::vector<JobPair> jobs,
                              MakeJobs(selection.workers, vertices,
                                       1 + round * selection.workers, options));
    ISOMATCH_ASSIGN_OR_RETURN(
        Round measured, MeasureRound(*service, jobs, options, round % 2 == 0));
    if (round > 0) rounds.push_back(std::move(measured));
  }
  Throughput result = Summarize(rounds);
  result.vertices = vertices;
  result.threads = options.threads;
  return result;
}

/// The same targets with and without the cache, one after the other by turns.
absl::StatusOr<TemplateRun> MeasureTemplate(const ServiceSelection& selection,
                                            int vertices,
                                            const MatchOptions& options) {
  ServerConfig config = ConfigOf(selection, options);
  TemplateRun result;
  config.prepared_cache_bytes = 0;
  ISOMATCH_ASSIGN_OR_RETURN(const auto without, LocalService::Start(config));
  config.prepared_cache_bytes = kCacheBytes;
  ISOMATCH_ASSIGN_OR_RETURN(const auto with, LocalService::Start(config));
  ISOMATCH_ASSIGN_OR_RETURN(const SentMesh x, MakeMesh('A', vertices, 1));
  for (int target = 0; target < selection.targets; ++target) {
    ISOMATCH_ASSIGN_OR_RETURN(
        const SentMesh y,
        MakeMesh(target % 2 == 0 ? 'B' : 'C', vertices, 2 + target));
    const JobPair job = MakeJob(x, y, options);
    ISOMATCH_ASSIGN_OR_RETURN(const ServiceRun plain,
                              without->Run(job.request));
    ISOMATCH_ASSIGN_OR_RETURN(const ServiceRun cached, with->Run(job.request));
    if (plain.y_from_x != cached.y_from_x) {
      return absl::InternalError("the cache changes a map");
    }
    result.without_cache.push_back(plain.seconds.total());
    result.with_cache.push_back(cached.seconds.total());
  }
  return result;
}

void Print(const Throughput& found, const ServiceSelection& selection) {
  const double jobs = kSecondsAMinute * selection.workers;
  std::printf(
      "\n%d vertices a side, %d at a time, %d threads each; median of %d pairs "
      "of runs\n  without the service  %8.3f s  %6.1f jobs a minute\n"
      "  through the service  %8.3f s  %6.1f jobs a minute\n"
      "  overhead             %7.2f %%  (%.2f to %.2f)\n"
      "  of a job, ms:",
      found.vertices, selection.workers, found.threads, selection.jobs,
      found.direct_seconds, jobs / found.direct_seconds, found.service_seconds,
      jobs / found.service_seconds, kPercent * found.overhead,
      kPercent * found.overhead_least, kPercent * found.overhead_most);
  for (const auto& [name, part] : kParts) {
    std::printf(" %s %.1f", name, kMilliseconds * (found.job.*part));
  }
  const double beside = found.job.total() - found.job.match;
  std::printf("\n  beside the method    %7.1f ms, %.2f %% of it\n",
              kMilliseconds * beside, kPercent * beside / found.job.match);
  std::fflush(stdout);
}

void Print(const TemplateRun& found) {
  if (found.with_cache.empty()) return;  // no targets were asked for
  const double plain = SumOf(found.without_cache);
  const double cached = SumOf(found.with_cache);
  const auto count = double(found.with_cache.size());
  std::printf(
      "  one template against %.0f targets, in turns\n"
      "  without the cache    %8.2f s  %6.1f jobs a minute\n"
      "  with it              %8.2f s  %6.1f jobs a minute, %.2f x\n",
      count, plain, kSecondsAMinute * count / plain, cached,
      kSecondsAMinute * count / cached, plain / cached);
  std::fflush(stdout);
}

nlohmann::json ToJson(const Throughput& found, const TemplateRun& cache) {
  nlohmann::json parts;
  for (const auto& [name, part] : kParts) parts[name] = found.job.*part;
  return {{"vertices", found.vertices},
          {"threads", found.threads},
          {"direct_seconds", found.direct_seconds},
          {"service_seconds", found.service_seconds},
          {"overhead", found.overhead},
          {"overhead_least", found.overhead_least},
          {"overhead_most", found.overhead_most},
          {"job_seconds", std::move(parts)},
          {"template_seconds_without_cache", cache.without_cache},
          {"template_seconds_with_cache", cache.with_cache}};
}

}  // namespace

absl::Status RunService(const ServiceSelection& selection,
                        const MatchOptions& options,
                        const std::string& out_path) {
  SetUpLog("off", LogFormat::kText);
  nlohmann::json report = {{"profile", ProfileName(options.profile)},
                           {"jobs", selection.jobs},
                           {"workers", selection.workers},
                           {"targets", selection.targets}};
  for (const int vertices : selection.sizes) {
    ISOMATCH_ASSIGN_OR_RETURN(const Throughput throughput,
                              MeasureThroughput(selection, vertices, options));
    Print(throughput, selection);
    TemplateRun cache;
    if (selection.targets > 0) {
      ISOMATCH_ASSIGN_OR_RETURN(cache,
                                MeasureTemplate(selection, vertices, options));
      Print(cache);
    }
    report["sizes"].push_back(ToJson(throughput, cache));
  }
  if (out_path.empty()) return absl::OkStatus();
  return WriteFileAtomically(out_path, report.dump(2) + "\n");
}

}  // namespace isomatch::bench
