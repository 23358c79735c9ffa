#include "tests/bench/speed.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "client/files/text_file.h"
#include "client/sample/sample_animal.h"
#include "core/base/status_macros.h"
#include "core/evaluation/geodesic_error.h"
#include "core/geodesic/basis_points.h"
#include "core/mesh/mesh_size.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/instruction_set.h"
#include "core/pipeline/matcher.h"
#include "core/pipeline/memory_estimate.h"
#include "core/pipeline/prepared_mesh.h"
#include "core/pipeline/prepared_shape.h"
#include "core/pipeline/progress.h"
#include "tests/bench/kernels.h"
#include "tests/bench/machine.h"
#include "tests/bench/own_process.h"
#include "tests/bench/pair_set.h"
#include "tests/bench/speed_report.h"
#include "tests/support/memory_growth.h"

namespace isomatch::bench {
namespace {

constexpr double kMegabyte = 1e6;
/// Exponents are fitted from this size on: below, constants rule.
constexpr int kFittedFrom = 5000;

struct StageCost {
  double wall = 0;
  double cpu = 0;
  double peak_bytes = 0;  ///< beyond what was held before the run
};

struct RunCost {
  std::map<Stage, StageCost> stages;
  double wall = 0;
  double cpu = 0;
  double peak_bytes = 0;
};

/// Runs of one pair.
struct PairCost {
  std::string name;
  int vertices = 0;  ///< of the larger mesh
  RunCost run;
  double estimate_bytes = 0;
  double prepared_seconds = 0;
  double prepared_bytes = 0;  ///< beyond the prepared shapes, of the first run
  double error = 0;
};

/// Times the stages of `match`, told apart by their progress.
class StageClock {
 public:
  explicit StageClock(RunCost* cost) : cost_(*cost) {
    begin_wall_ = stage_wall_ = WallSeconds();
    begin_cpu_ = stage_cpu_ = CpuSeconds();
  }

  void Observe(const Progress& progress) {
    if (running_ && progress.stage == stage_) return;
    EndStage();
    stage_ = progress.stage;
    running_ = true;
  }

  void Finish() {
    EndStage();
    cost_.wall = WallSeconds() - begin_wall_;
    cost_.cpu = CpuSeconds() - begin_cpu_;
  }

 private:
  void EndStage() {
    const double wall = WallSeconds();
    const double cpu = CpuSeconds();
    if (running_) {
      // The peak so far: stages do not forget what those before them held.
      const double peak = double(grown_.Bytes());
      cost_.stages[stage_] = {wall - stage_wall_, cpu - stage_cpu_, peak};
      cost_.peak_bytes = std::max(cost_.peak_bytes, peak);
    }
    stage_wall_ = wall;
    stage_cpu_ = cpu;
  }

  RunCost& cost_;
  const MemoryGrowth grown_;
  bool running_ = false;
  Stage stage_ = Stage::kPrepare;
  double begin_wall_, stage_wall_, begin_cpu_, stage_cpu_;
};

/// Medians of times and maxima of memory, figure by figure. (Of a process the
/// first run adds most: later ones use again what it gave back.)
RunCost Summary(const std::vector<RunCost>& runs) {
  const auto values = [&](const auto& of) {
    std::vector<double> result;
    for (const RunCost& run : runs) result.push_back(of(run));
    return result;
  };
  const auto median = [&](const auto& of) { return MedianOf(values(of)); };
  const auto most = [&](const auto& of) {
    return std::ranges::max(values(of));
  };
  RunCost result;
  result.wall = median([](const RunCost& run) { return run.wall; });
  result.cpu = median([](const RunCost& run) { return run.cpu; });
  result.peak_bytes = most([](const RunCost& run) { return run.peak_bytes; });
  for (const auto& [name, unused] : runs.front().stages) {
    const auto of = [stage = name](double StageCost::*figure) {
      return [=](const RunCost& run) { return run.stages.at(stage).*figure; };
    };
    result.stages[name] = {median(of(&StageCost::wall)),
                           median(of(&StageCost::cpu)),
                           most(of(&StageCost::peak_bytes))};
  }
  return result;
}

absl::StatusOr<PairCost> MeasurePair(const MeshPair& pair, int runs,
                                     const MatchOptions& options) {
  PairCost cost;
  cost.name = pair.name_x + " " + pair.name_y;
  cost.vertices =
      std::max(pair.mesh_x.num_vertices(), pair.mesh_y.num_vertices());
  cost.estimate_bytes = double(EstimateMemoryBytes(
      SizeOf(pair.mesh_x), SizeOf(pair.mesh_y), 0, options));
  std::vector<RunCost> costs;
  std::vector<double> prepared_seconds;
  VertexMap found;
  for (int run = 0; run < runs; ++run) {
    costs.emplace_back();
    StageClock clock(&costs.back());
    ISOMATCH_ASSIGN_OR_RETURN(
        Correspondence result,
        Match(pair.mesh_x, pair.mesh_y, {}, options,
              {[&](const Progress& progress) { clock.Observe(progress); }}));
    clock.Finish();
    found = std::move(result.y_from_x);
  }
  cost.run = Summary(costs);
  ISOMATCH_ASSIGN_OR_RETURN(const PreparedShape x,
                            Prepare(pair.mesh_x, options));
  ISOMATCH_ASSIGN_OR_RETURN(const PreparedShape y,
                            Prepare(pair.mesh_y, options));
  for (int run = 0; run < runs; ++run) {
    const MemoryGrowth grown;
    const double begin = WallSeconds();
    ISOMATCH_RETURN_IF_ERROR(MatchPrepared(x, y, {}, options).status());
    prepared_seconds.push_back(WallSeconds() - begin);
    if (run == 0) cost.prepared_bytes = double(grown.Bytes());
  }
  cost.prepared_seconds = MedianOf(std::move(prepared_seconds));
  ISOMATCH_ASSIGN_OR_RETURN(
      const GeodesicError error,
      GeodesicErrorMeter(pair.mesh_y).Measure(found, pair.truth.direct));
  cost.error = error.mean_over_diameter;
  return cost;
}

absl::StatusOr<MeshPair> SamplePair(int vertices) {
  ISOMATCH_ASSIGN_OR_RETURN(const Sample x,
                            MakeSample({.pose = 'A', .vertices = vertices}));
  ISOMATCH_ASSIGN_OR_RETURN(const Sample y,
                            MakeSample({.pose = 'B', .vertices = vertices}));
  return MeshPair{
      "sample A", "sample B", x.mesh, y.mesh, {SampleTruth(x, y), {}}};
}

/// What a stage's cost is divided by.
const char* UnitOf(Stage stage) {
  return stage == Stage::kGeodesics ? "vertex solved on and source" : "vertex";
}

/// How many of them a pair has.
double UnitsOf(Stage stage, const PairCost& cost, const MatchOptions& options) {
  if (stage != Stage::kGeodesics) return 2.0 * cost.vertices;
  const int solved = IsDecimated(cost.vertices, options)
                         ? options.solved_vertices
                         : cost.vertices;
  return 2.0 * solved * BasisPoints::DefaultCount(solved);
}

/// How near the kernels of a stage come to the machine's limit: "14 to 57 %",
/// or
/// "-" for one that has none.
std::string LimitReached(Stage stage, const nlohmann::json& kernels) {
  double least = HUGE_VAL;
  double most = 0;
  for (const nlohmann::json& kernel : kernels) {
    const std::vector<std::string> stages = kernel["stages"];
    if (std::ranges::find(stages, StageName(stage)) == stages.end()) continue;
    const double share =
        kernel["rate"].get<double>() / kernel["machine"].get<double>();
    least = std::min(least, share);
    most = std::max(most, share);
  }
  if (most == 0) return "-";
  if (least == most) return absl::StrFormat("%.0f %%", 100 * most);
  return absl::StrFormat("%.0f to %.0f %%", 100 * least, 100 * most);
}

void PrintPair(const PairCost& cost, const MatchOptions& options,
               const nlohmann::json& kernels) {
  std::printf(
      "\n%s, %d vertices: %.2f s (processor %.2f), with both prepared "
      "%.2f s and %.0f MB\n  peak %.0f MB, estimate %.0f MB (%.2f x), error / "
      "diameter %.4f\n",
      cost.name.c_str(), cost.vertices, cost.run.wall, cost.run.cpu,
      cost.prepared_seconds, cost.prepared_bytes / kMegabyte,
      cost.run.peak_bytes / kMegabyte, cost.estimate_bytes / kMegabyte,
      cost.estimate_bytes / cost.run.peak_bytes, cost.error);
  std::printf("  %-18s %9s %9s %12s %12s  %s\n", "stage", "wall s", "cpu s",
              "peak so far", "of limit", "ns a unit of work");
  for (const auto& [stage, figures] : cost.run.stages) {
    std::printf(
        "  %-18s %9.3f %9.3f %9.0f MB %12s  %.0f a %s\n", StageName(stage),
        figures.wall, figures.cpu, figures.peak_bytes / kMegabyte,
        LimitReached(stage, kernels).c_str(),
        1e9 * figures.cpu / UnitsOf(stage, cost, options), UnitOf(stage));
  }
}

/// Slope of log(figure) over log(vertices), least squares; 0 for fewer than two
/// sizes.
double Exponent(const nlohmann::json& pairs, const char* figure) {
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (const nlohmann::json& pair : pairs) {
    const double vertices = pair["vertices"];
    if (vertices < kFittedFrom) continue;
    const double x = std::log(vertices);
    const double y = std::log(pair[figure].get<double>());
    n += 1;
    sx += x;
    sy += y;
    sxx += x * x;
    sxy += x * y;
  }
  const double spread = n * sxx - sx * sx;
  return spread > 0 ? (n * sxy - sx * sy) / spread : 0;
}

nlohmann::json ToJson(const PairCost& cost, const MatchOptions& options) {
  nlohmann::json stages;
  for (const auto& [stage, figures] : cost.run.stages) {
    stages[StageName(stage)] = {
        {"wall_seconds", figures.wall},
        {"cpu_seconds", figures.cpu},
        {"peak_bytes_so_far", figures.peak_bytes},
        {"unit", UnitOf(stage)},
        {"cpu_ns_per_unit", 1e9 * figures.cpu / UnitsOf(stage, cost, options)}};
  }
  return {{"pair", cost.name},
          {"vertices", cost.vertices},
          {"wall_seconds", cost.run.wall},
          {"cpu_seconds", cost.run.cpu},
          {"prepared_wall_seconds", cost.prepared_seconds},
          {"prepared_bytes", cost.prepared_bytes},
          {"peak_bytes", cost.run.peak_bytes},
          {"estimate_bytes", cost.estimate_bytes},
          {"error_over_diameter", cost.error},
          {"stages", std::move(stages)}};
}

nlohmann::json PrintKernels() {
  const MachineLimits machine = MeasureMachine();
  std::printf("machine: %.1f GFLOP/s (float products), %.1f GB/s (reading)\n",
              machine.gflop_per_s, machine.read_gb_per_s);
  nlohmann::json kernels;
  for (const KernelCost& kernel : MeasureKernels()) {
    const double limit =
        kernel.is_arithmetic ? machine.gflop_per_s : machine.read_gb_per_s;
    std::vector<std::string> stages;
    for (const Stage stage : kernel.stages) stages.push_back(StageName(stage));
    std::printf(
        "  %-34s %8.2f ns a %-18s %6.1f %-7s %3.0f %% of the machine's  (%s)\n",
        kernel.name.c_str(), kernel.ns_per_unit, kernel.unit.c_str(),
        kernel.rate, kernel.is_arithmetic ? "GFLOP/s" : "GB/s",
        100 * kernel.rate / limit, absl::StrJoin(stages, ", ").c_str());
    kernels.push_back({{"kernel", kernel.name},
                       {"stages", std::move(stages)},
                       {"unit", kernel.unit},
                       {"ns_per_unit", kernel.ns_per_unit},
                       {"rate", kernel.rate},
                       {"machine", limit}});
  }
  return kernels;
}

void PrintMean(const nlohmann::json& pairs) {
  const nlohmann::json mean = MeanOfPairs(pairs);
  std::printf(
      "\nmean of %d pairs: %.3f s (processor %.3f), with both prepared "
      "%.3f s\n  %-18s %9s %9s\n",
      static_cast<int>(pairs.size()), mean["wall_seconds"].get<double>(),
      mean["cpu_seconds"].get<double>(),
      mean["prepared_wall_seconds"].get<double>(), "stage", "wall s", "cpu s");
  for (const auto& [stage, figures] : mean["stages"].items()) {
    std::printf("  %-18s %9.3f %9.3f\n", stage.c_str(),
                figures["wall_seconds"].get<double>(),
                figures["cpu_seconds"].get<double>());
  }
}

using PairSource = std::function<absl::StatusOr<MeshPair>()>;

absl::StatusOr<std::vector<PairSource>> SelectedPairs(
    const SpeedSelection& selection) {
  std::vector<PairSource> pairs;
  if (selection.dir.empty()) {
    for (const int size : selection.sizes) {
      pairs.push_back([size] { return SamplePair(size); });
    }
    return pairs;
  }
  ISOMATCH_ASSIGN_OR_RETURN(const auto names,
                            ReadPairNames(selection.dir + "/pairs.txt"));
  for (const auto& [x, y] : names) {
    if ((x + " " + y).find(selection.filter) == std::string::npos) continue;
    pairs.push_back(
        [dir = selection.dir, x = x, y = y] { return ReadPair(dir, x, y); });
  }
  return pairs;
}

/// The figures of the pairs, each from a process of its own.
absl::StatusOr<nlohmann::json> MeasurePairs(
    const std::vector<PairSource>& sources, int runs,
    const MatchOptions& options, const nlohmann::json& kernels) {
  nlohmann::json pairs;
  for (const PairSource& source : sources) {
    ISOMATCH_ASSIGN_OR_RETURN(
        nlohmann::json figures,
        InOwnProcess([&]() -> absl::StatusOr<nlohmann::json> {
          ISOMATCH_ASSIGN_OR_RETURN(const MeshPair pair, source());
          ISOMATCH_ASSIGN_OR_RETURN(const PairCost cost,
                                    MeasurePair(pair, runs, options));
          PrintPair(cost, options, kernels);
          return ToJson(cost, options);
        }));
    pairs.push_back(std::move(figures));
  }
  return pairs;
}

}  // namespace

absl::Status RunSpeed(const SpeedSelection& selection,
                      const MatchOptions& options,
                      const std::string& out_path) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::vector<PairSource> sources,
                            SelectedPairs(selection));
  if (sources.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("--filter: no pair of ", selection.dir, " contains \"",
                     selection.filter, "\""));
  }
  nlohmann::json kept;
  if (!selection.against.empty()) {
    ISOMATCH_ASSIGN_OR_RETURN(kept, ReadSpeedReport(selection.against));
  }
  std::printf(
      "profile %s, %s threads, instruction set %s, median of %d runs\n",
      ProfileName(options.profile),
      options.threads == 0 ? "all" : std::to_string(options.threads).c_str(),
      InstructionSet().c_str(), selection.runs);
  ISOMATCH_ASSIGN_OR_RETURN(
      nlohmann::json kernels,
      InOwnProcess(
          []() -> absl::StatusOr<nlohmann::json> { return PrintKernels(); }));
  ISOMATCH_ASSIGN_OR_RETURN(
      nlohmann::json pairs,
      MeasurePairs(sources, selection.runs, options, kernels));
  const double time = Exponent(pairs, "wall_seconds");
  const double memory = Exponent(pairs, "peak_bytes");
  if (selection.dir.empty() && time != 0) {
    std::printf(
        "\nfrom %d vertices on: time grows as n^%.2f, memory as n^%.2f\n",
        kFittedFrom, time, memory);
  }
  if (!selection.dir.empty()) PrintMean(pairs);
  const nlohmann::json report = {{"profile", ProfileName(options.profile)},
                                 {"threads", options.threads},
                                 {"instruction_set", InstructionSet()},
                                 {"runs", selection.runs},
                                 {"time_exponent", time},
                                 {"memory_exponent", memory},
                                 {"kernels", std::move(kernels)},
                                 {"pairs", std::move(pairs)}};
  if (!out_path.empty()) {
    ISOMATCH_RETURN_IF_ERROR(
        WriteFileAtomically(out_path, report.dump(2) + "\n"));
  }
  if (!selection.against.empty()) {
    std::printf("\n%s", ComparisonText(report, kept).c_str());
  }
  return absl::OkStatus();
}

}  // namespace isomatch::bench
