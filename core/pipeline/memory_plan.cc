#include "core/pipeline/memory_plan.h"
#include "core/pipeline/memory_estimate.h"

#include <algorithm>
#include <limits>
#include <thread>

#include "absl/strings/str_cat.h"

namespace isomatch {
namespace {

/// Planned numbers of vertices are multiples of this.
constexpr int kStep = 100;

/// Estimates of one pair.
class Estimates {
 public:
  Estimates(MeshSize x, MeshSize y, std::int64_t num_landmarks,
            const MatchOptions& options, std::int64_t held_bytes)
      : x_(x),
        y_(y),
        num_landmarks_(num_landmarks),
        options_(options),
        held_bytes_(held_bytes) {}

  std::int64_t WithThreads(MatchOptions options, int threads) const {
    options.threads = threads;
    const std::int64_t own =
        EstimateMemoryBytes(x_, y_, num_landmarks_, options);
    constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
    return own + std::min(held_bytes_, kMost - own);
  }

  std::int64_t Solving(std::int64_t vertices) const {
    MatchOptions options = options_;
    options.solved_vertices = static_cast<int>(vertices);
    return WithThreads(options, 1);
  }

  /// The most vertices that may be solved on, or less than
  /// kFewestPlannedVertices if even those are too many. Estimates grow with
  /// them, but for a tenth where decimation sets in.
  int MostSolved() const {
    std::int64_t most = std::max(x_.vertices, y_.vertices);
    if (options_.solved_vertices > 0) {
      most = std::min<std::int64_t>(most, options_.solved_vertices);
    }
    std::int64_t low = kFewestPlannedVertices / kStep - 1;
    std::int64_t high = std::min<std::int64_t>(most, kMostPlanned) / kStep;
    while (low < high) {
      const std::int64_t middle = (low + high + 1) / 2;
      if (Solving(middle * kStep) <= options_.memory_limit_bytes) {
        low = middle;
      } else {
        high = middle - 1;
      }
    }
    return static_cast<int>(low * kStep);
  }

 private:
  /// MatchOptions::solved_vertices allows no more.
  static constexpr std::int64_t kMostPlanned = 1'000'000'000;

  MeshSize x_;
  MeshSize y_;
  std::int64_t num_landmarks_;
  const MatchOptions& options_;
  std::int64_t held_bytes_;
};

int ThreadsOf(const MatchOptions& options) {
  if (options.threads > 0) return options.threads;
  return static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
}

absl::Status TooLittle(const Estimates& estimates,
                       const MatchOptions& options) {
  const std::int64_t least = std::min(estimates.Solving(kFewestPlannedVertices),
                                      estimates.WithThreads(options, 1));
  return absl::InvalidArgumentError(absl::StrCat(
      "options.memory_limit_bytes: ", options.memory_limit_bytes,
      ", expected at least ", least, " for meshes of these sizes, solved on ",
      kFewestPlannedVertices, " vertices"));
}

}  // namespace

absl::StatusOr<MemoryPlan> PlanWithinMemory(MeshSize x, MeshSize y,
                                            std::int64_t num_landmarks,
                                            const MatchOptions& options,
                                            std::int64_t held_bytes) {
  MemoryPlan plan = {options, {}};
  const std::int64_t limit = options.memory_limit_bytes;
  if (limit == 0) return plan;
  const Estimates estimates(x, y, num_landmarks, options, held_bytes);
  // With one thread, so that what is solved on is the same on any machine.
  if (estimates.WithThreads(options, 1) > limit) {
    plan.options.solved_vertices = estimates.MostSolved();
    if (plan.options.solved_vertices < kFewestPlannedVertices) {
      return TooLittle(estimates, options);
    }
    plan.warnings.push_back(
        absl::StrCat("solved on ", plan.options.solved_vertices,
                     " vertices to stay within the memory limit of ", limit,
                     " bytes; maps are less exact than without"));
  }
  int threads = ThreadsOf(options);
  while (threads > 1 && estimates.WithThreads(plan.options, threads) > limit) {
    --threads;
  }
  if (threads < ThreadsOf(options)) plan.options.threads = threads;
  return plan;
}

bool IsDecimatedWell(MeshSize left, const MatchOptions& options) {
  constexpr double kWell = 1.5;
  return options.solved_vertices == 0 ||
         static_cast<double>(left.vertices) <= kWell * options.solved_vertices;
}

absl::Status CheckDecimated(const DecimatedSize& x, const DecimatedSize& y,
                            const MatchOptions& options) {
  const std::int64_t limit = options.memory_limit_bytes;
  if (limit == 0) return absl::OkStatus();
  const MeshSize wanted = {options.solved_vertices,
                           2 * std::int64_t{options.solved_vertices}};
  MatchOptions as_it_is = options;
  as_it_is.solved_vertices = 0;
  const std::int64_t as_wanted =
      EstimateMemoryBytes(wanted, wanted, 0, as_it_is);
  std::int64_t needed = EstimateMemoryBytes(x.mesh, y.mesh, 0, options);
  const DecimatedSize* worst = nullptr;
  for (const DecimatedSize* size : {&x, &y}) {
    if (IsDecimatedWell(size->left, options)) continue;
    needed += EstimateMemoryBytes(size->left, wanted, 0, as_it_is) - as_wanted;
    if (worst == nullptr || size->left.vertices > worst->left.vertices) {
      worst = size;
    }
  }
  if (worst == nullptr || needed <= limit) return absl::OkStatus();
  return absl::ResourceExhaustedError(absl::StrCat(
      "a mesh of ", worst->mesh.vertices, " vertices can be decimated to ",
      worst->left.vertices, " only, not ", wanted.vertices,
      ", and the match needs ", needed, " bytes so, expected at most ", limit,
      "; is it a surface?"));
}

}  // namespace isomatch
