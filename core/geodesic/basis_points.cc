#include "core/geodesic/basis_points.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include <Eigen/Core>

#include "core/base/mutex.h"
#include "core/base/parallel.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

using Row = Eigen::Map<const Eigen::ArrayXf>;

/// Called with the number of sources done since the last call.
using Report = std::function<void(std::size_t)>;

/// Calls `take` for each group of points with where its fields are.
template <typename Take>
absl::Status SweepFields(const FieldSweeps& sweeps,
                         absl::Span<const VertexIndex> points,
                         const std::stop_token& stop, const Take& take) {
  const std::vector<std::vector<int>> groups = sweeps.Groups(points);
  const auto solve_group = [&](std::int64_t g) {
    FieldSweeps::Workspace workspace;
    sweeps.Solve(points, groups[g], stop, &workspace);
    take(groups[g], workspace);
  };
  return ParallelFor(static_cast<std::int64_t>(groups.size()), stop,
                     solve_group);
}

absl::Status SolveFields(const DistanceFieldSolver& solver,
                         absl::Span<const VertexIndex> points,
                         const Report& report, const std::stop_token& stop,
                         float* fields) {
  constexpr std::size_t kSourcesPerTask = 4;  // with one workspace
  const auto solve_some = [&](std::int64_t task) {
    DistanceFieldSolver::Workspace workspace;
    const std::size_t begin = task * kSourcesPerTask;
    const std::size_t end = std::min(begin + kSourcesPerTask, points.size());
    for (std::size_t z = begin; z < end && !stop.stop_requested(); ++z) {
      solver.Solve(points[z], fields + z,
                   static_cast<std::int64_t>(points.size()), &workspace);
      report(1);
    }
  };
  return ParallelFor(
      static_cast<std::int64_t>((points.size() + kSourcesPerTask - 1) /
                                kSourcesPerTask),
      stop, solve_some);
}

/// Of all vertices, `count` sources a row.
void WriteFields(const FieldSweeps& sweeps, const FieldSweeps::Workspace& found,
                 const std::vector<int>& group, std::int64_t count,
                 float* fields) {
  for (VertexIndex v = 0; v < sweeps.num_vertices(); ++v) {
    for (std::size_t lane = 0; lane < group.size(); ++lane) {
      fields[v * count + group[lane]] = sweeps.Distance(found, v, lane);
    }
  }
}

/// Of the points, one source a column.
void WriteAmong(const FieldSweeps& sweeps, const FieldSweeps::Workspace& found,
                const std::vector<int>& group,
                absl::Span<const VertexIndex> points,
                Eigen::MatrixXf* distances) {
  for (std::size_t j = 0; j < points.size(); ++j) {
    for (std::size_t lane = 0; lane < group.size(); ++lane) {
      (*distances)(static_cast<Eigen::Index>(j), group[lane]) =
          sweeps.Distance(found, points[j], lane);
    }
  }
}

bool IsSwept(const DistanceFieldSolver& solver) {
  return solver.num_vertices() <= FieldSweeps::kMostVertices;
}

}  // namespace

int BasisPoints::DefaultCount(VertexIndex num_vertices) {
  constexpr int kFewest = 16;
  const int root =
      static_cast<int>(std::lround(std::sqrt(double{1} * num_vertices)));
  return std::min<int>(std::max(root, kFewest), num_vertices);
}

absl::StatusOr<BasisPoints> BasisPoints::Create(
    const DistanceFieldSolver& solver, std::vector<VertexIndex> points,
    const std::function<void(double)>& progress, const std::stop_token& stop,
    float least_change) {
  BasisPoints basis;
  basis.points_ = std::move(points);
  basis.num_vertices_ = solver.num_vertices();
  const int count = basis.num_points();
  basis.fields_.resize(std::int64_t{basis.num_vertices_} * count);
  Mutex mutex;
  std::size_t done = 0;
  const auto report = [&](std::size_t sources) {
    const MutexLock lock(mutex);
    done += sources;
    if (progress && !stop.stop_requested()) progress(double(done) / count);
  };
  float* const fields = basis.fields_.data();
  if (IsSwept(solver)) {
    const FieldSweeps sweeps(solver.stencils(), least_change);
    const auto write = [&](const std::vector<int>& group,
                           const FieldSweeps::Workspace& found) {
      WriteFields(sweeps, found, group, count, fields);
      report(group.size());
    };
    ISOMATCH_RETURN_IF_ERROR(SweepFields(sweeps, basis.points_, stop, write));
  } else {
    ISOMATCH_RETURN_IF_ERROR(
        SolveFields(solver, basis.points_, report, stop, fields));
  }
  // A stop during the last sources left them undone.
  ISOMATCH_RETURN_IF_ERROR(CheckNotCancelled(stop));
  return basis;
}

BasisPoints BasisPoints::FromFields(std::vector<VertexIndex> points,
                                    VertexIndex num_vertices,
                                    std::vector<float> fields) {
  BasisPoints basis;
  basis.points_ = std::move(points);
  basis.num_vertices_ = num_vertices;
  basis.fields_ = std::move(fields);
  return basis;
}

float BasisPoints::LowerBound(VertexIndex u, VertexIndex v) const {
  return (Row(Profile(u), num_points()) - Row(Profile(v), num_points()))
      .abs()
      .maxCoeff();
}

float BasisPoints::UpperBound(VertexIndex u, VertexIndex v) const {
  return (Row(Profile(u), num_points()) + Row(Profile(v), num_points()))
      .minCoeff();
}

std::vector<int> BasisPoints::Nearest(VertexIndex v, int count) const {
  std::vector<int> order(num_points());
  std::iota(order.begin(), order.end(), 0);
  const auto middle = order.begin() + std::min(count, num_points());
  const float* const profile = Profile(v);
  std::partial_sort(order.begin(), middle, order.end(), [&](int a, int b) {
    return std::pair(profile[a], a) < std::pair(profile[b], b);
  });
  return {order.begin(), middle};  // without the room of all of them
}

float BasisPoints::MeanDistance(int z) const {
  double sum = 0;
  VertexIndex reached = 0;
  for (VertexIndex v = 0; v < num_vertices_; ++v) {
    if (Distance(v, z) == kUnreachable) continue;
    sum += Distance(v, z);
    ++reached;
  }
  return static_cast<float>(sum / std::max<VertexIndex>(reached, 1));
}

absl::StatusOr<Eigen::MatrixXf> DistancesAmong(
    const DistanceFieldSolver& solver, absl::Span<const VertexIndex> points,
    const std::stop_token& stop, float least_change) {
  const auto count = static_cast<std::int64_t>(points.size());
  Eigen::MatrixXf distances(count, count);
  if (IsSwept(solver)) {
    const FieldSweeps sweeps(solver.stencils(), least_change);
    const auto write = [&](const std::vector<int>& group,
                           const FieldSweeps::Workspace& found) {
      WriteAmong(sweeps, found, group, points, &distances);
    };
    ISOMATCH_RETURN_IF_ERROR(SweepFields(sweeps, points, stop, write));
  } else {
    const auto solve = [&](std::int64_t z) {
      DistanceFieldSolver::Workspace workspace;
      std::vector<float> field(solver.num_vertices());
      solver.Solve(points[z], field.data(), 1, &workspace);
      for (std::int64_t j = 0; j < count; ++j) {
        distances(j, z) = field[points[j]];
      }
    };
    ISOMATCH_RETURN_IF_ERROR(ParallelFor(count, stop, solve));
  }
  ISOMATCH_RETURN_IF_ERROR(CheckNotCancelled(stop));
  return 0.5f * (distances + distances.transpose());
}

Environments EnvironmentsOf(const BasisPoints& basis,
                            absl::Span<const VertexIndex> vertices) {
  const int each =
      std::min(BasisPoints::kEnvironmentsPerVertex, basis.num_points());
  std::vector<int> nearest;
  nearest.reserve(each * vertices.size());
  for (const VertexIndex v : vertices) {
    const std::vector<int> of_vertex = basis.Nearest(v, each);
    nearest.insert(nearest.end(), of_vertex.begin(), of_vertex.end());
  }
  return {std::ssize(nearest), basis.num_points(),
          [&](std::int64_t i) { return nearest[i]; },
          [&](std::int64_t i) { return static_cast<std::int32_t>(i / each); }};
}

}  // namespace isomatch
