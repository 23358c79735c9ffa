#include "core/evaluation/geodesic_error.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/parallel.h"
#include "core/base/status_macros.h"
#include "core/geodesic/distance_field_solver.h"
#include "core/geodesic/farthest_point_sampling.h"
#include "core/mesh/clean_mesh.h"
#include "core/mesh/mesh_geometry.h"

namespace isomatch {

namespace {

/// Extremities among which the diameter is sought.
constexpr int kDiameterPoints = 32;

/// A place that was found: the corners that have weight, in its face.
struct Target {
  std::array<VertexIndex, 3> corners;
  std::array<double, 3> weights;
  int size = 0;
};

/// What was found for one true vertex, and where the errors go.
struct Query {
  VertexIndex source;  ///< the true vertex
  std::vector<Target> targets;
  std::vector<std::size_t> entries;  ///< vertices of X
  std::vector<float> distances;
};

double Diameter(const DistanceFieldSolver& solver) {
  DistanceFieldSolver::Workspace workspace;
  const auto points = FarthestPoints(solver, kDiameterPoints, {});
  std::vector<float> field(solver.num_vertices());
  float diameter = 0;
  for (const VertexIndex point : *points) {
    solver.Solve(point, field.data(), 1, &workspace);
    for (const float distance : field) {
      if (distance < kUnreachable) diameter = std::max(diameter, distance);
    }
  }
  return diameter;
}

/// Clean vertex of `y`, or an error that names `what` and the entry.
absl::StatusOr<VertexIndex> CleanVertex(const CleanMesh& clean,
                                        const char* what, std::size_t x,
                                        VertexIndex y) {
  const auto n = static_cast<VertexIndex>(clean.clean_from_original.size());
  if (y < 0 || y >= n) {
    return absl::InvalidArgumentError(absl::StrCat(
        what, "[", x, "]: ", y, ", expected 0 to ", n - 1, " or -1"));
  }
  if (clean.clean_from_original[y] == kNoVertex) {
    return absl::InvalidArgumentError(
        absl::StrCat(what, "[", x, "]: vertex ", y, " of Y is on no face"));
  }
  return clean.clean_from_original[y];
}

absl::StatusOr<Target> CleanTarget(const CleanMesh& clean, std::size_t x,
                                   const PrecisePoint& point) {
  Target target;
  for (std::size_t i = 0; i < 3; ++i) {
    if (!(point.weights[i] > 0)) continue;
    ISOMATCH_ASSIGN_OR_RETURN(target.corners[target.size],
                              CleanVertex(clean, "map", x, point.vertices[i]));
    target.weights[target.size++] = point.weights[i];
  }
  return target;
}

/// The way to the place p over the edge from a to b: the straight line from the
/// virtual source, where it crosses the edge.
double OverEdge(const Eigen::RowVector3d& p, const Eigen::RowVector3d& a,
                const Eigen::RowVector3d& b, double from_a, double from_b) {
  constexpr double kNoWay = std::numeric_limits<double>::infinity();
  const double base = (b - a).norm();
  if (!(base > 0)) return kNoWay;
  const Eigen::RowVector3d along = (b - a) / base;
  const double px = (p - a).dot(along);
  const double py = (p - a - px * along).norm();
  const double x = 0.5 * (base + (from_a - from_b) * (from_a + from_b) / base);
  const double y_squared = from_a * from_a - x * x;
  if (!(y_squared >= 0)) return kNoWay;
  const double down = py + std::sqrt(y_squared);
  const double crossing = x * py + px * std::sqrt(y_squared);
  if (!(crossing >= 0 && crossing <= base * down)) return kNoWay;
  return std::hypot(px - x, down);
}

/// The distance of the place, given those of its corners.
double DistanceTo(const TriangleMesh& mesh, const Target& target,
                  const float* of_corners) {
  if (target.size == 1) return of_corners[0];
  const auto corner = [&](int i) {
    return mesh.positions.row(target.corners[i]);
  };
  Eigen::RowVector3d place = Eigen::RowVector3d::Zero();
  for (int i = 0; i < target.size; ++i) place += target.weights[i] * corner(i);
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < target.size; ++i) {
    least = std::min(least, of_corners[i] + (place - corner(i)).norm());
    for (int j = 0; j < i; ++j) {
      least = std::min(least, OverEdge(place, corner(i), corner(j),
                                       of_corners[i], of_corners[j]));
    }
  }
  return least;
}

/// Writes the distances of a query.
void Solve(const DistanceFieldSolver& solver, const TriangleMesh& mesh,
           DistanceFieldSolver::Workspace* workspace, Query* query) {
  std::vector<VertexIndex> corners;
  for (const Target& target : query->targets) {
    corners.insert(corners.end(), target.corners.begin(),
                   target.corners.begin() + target.size);
  }
  std::vector<float> of_corners(corners.size());
  solver.SolveTo(query->source, corners, absl::MakeSpan(of_corners), workspace);
  const float* next = of_corners.data();
  for (std::size_t t = 0; t < query->targets.size(); ++t) {
    query->distances[t] =
        static_cast<float>(DistanceTo(mesh, query->targets[t], next));
    next += query->targets[t].size;
  }
}

/// Groups the comparisons by true vertex, so that one front serves them all.
absl::StatusOr<std::vector<Query>> Queries(const CleanMesh& clean,
                                           absl::Span<const PrecisePoint> found,
                                           absl::Span<const VertexIndex> truth,
                                           GeodesicError* error) {
  if (found.size() != truth.size()) {
    return absl::InvalidArgumentError(
        absl::StrCat("the map has ", found.size(), " entries, the truth ",
                     truth.size(), ", expected equally many"));
  }
  std::map<VertexIndex, Query> by_truth;
  for (std::size_t x = 0; x < truth.size(); ++x) {
    if (truth[x] == kNoVertex) continue;
    ++error->evaluated;
    if (found[x].vertices[0] == kNoVertex) {
      ++error->unmatched;
      continue;
    }
    ISOMATCH_ASSIGN_OR_RETURN(const VertexIndex source,
                              CleanVertex(clean, "truth", x, truth[x]));
    ISOMATCH_ASSIGN_OR_RETURN(const Target target,
                              CleanTarget(clean, x, found[x]));
    Query& query = by_truth[source];
    query.source = source;
    query.targets.push_back(target);
    query.entries.push_back(x);
  }
  if (by_truth.empty()) {
    return absl::InvalidArgumentError(
        "no vertex has both a truth and a match, nothing to compare");
  }
  std::vector<Query> queries;
  for (auto& [source, query] : by_truth) {
    query.distances.resize(query.targets.size());
    queries.push_back(std::move(query));
  }
  return queries;
}

}  // namespace

GeodesicErrorMeter::GeodesicErrorMeter(const TriangleMesh& mesh_y)
    : clean_(Clean(mesh_y)),
      solver_(clean_.mesh),
      diameter_(Diameter(solver_)),
      sqrt_area_(std::sqrt(SurfaceArea(clean_.mesh))) {}

absl::StatusOr<GeodesicError> GeodesicErrorMeter::Measure(
    absl::Span<const VertexIndex> found, absl::Span<const VertexIndex> truth,
    const std::stop_token& stop) const {
  std::vector<PrecisePoint> places(found.size());
  for (std::size_t x = 0; x < found.size(); ++x) {
    places[x] = {{found[x], kNoVertex, kNoVertex}, {1, 0, 0}};
  }
  return MeasurePlaces(places, truth, stop);
}

absl::StatusOr<GeodesicError> GeodesicErrorMeter::Measure(
    const Faces& faces_y, absl::Span<const SurfacePoint> found,
    absl::Span<const VertexIndex> truth, const std::stop_token& stop) const {
  std::vector<PrecisePoint> places(found.size());
  for (std::size_t x = 0; x < found.size(); ++x) {
    if (found[x].face == kNoVertex) continue;
    for (int i = 0; i < 3; ++i) {
      places[x].vertices[i] = faces_y(found[x].face, i);
      places[x].weights[i] = found[x].weights[i];
    }
  }
  return MeasurePlaces(places, truth, stop);
}

absl::StatusOr<GeodesicError> GeodesicErrorMeter::MeasurePlaces(
    absl::Span<const PrecisePoint> found, absl::Span<const VertexIndex> truth,
    const std::stop_token& stop) const {
  GeodesicError error;
  error.diameter = diameter_;
  error.sqrt_area = sqrt_area_;
  ISOMATCH_ASSIGN_OR_RETURN(std::vector<Query> queries,
                            Queries(clean_, found, truth, &error));
  constexpr std::int64_t kPerTask = 64;
  const auto count = static_cast<std::int64_t>(queries.size());
  const std::int64_t tasks = (count + kPerTask - 1) / kPerTask;
  ISOMATCH_RETURN_IF_ERROR(ParallelFor(tasks, stop, [&](std::int64_t task) {
    DistanceFieldSolver::Workspace workspace;
    const std::int64_t end = std::min(count, (task + 1) * kPerTask);
    for (std::int64_t i = task * kPerTask; i < end; ++i) {
      Solve(solver_, clean_.mesh, &workspace, &queries[i]);
    }
  }));
  double sum = 0;
  int compared = 0;
  error.of_vertex.assign(truth.size(), -1);
  for (const Query& query : queries) {
    for (std::size_t t = 0; t < query.targets.size(); ++t) {
      const double fraction = std::min(1.0, query.distances[t] / diameter_);
      error.of_vertex[query.entries[t]] = static_cast<float>(fraction);
      sum += fraction;
      ++compared;
      error.max_over_diameter = std::max(error.max_over_diameter, fraction);
      for (std::size_t i = 0; i < kErrorThresholds.size(); ++i) {
        error.within[i] += fraction <= kErrorThresholds[i];
      }
    }
  }
  error.mean_over_diameter = sum / compared;
  error.mean_over_sqrt_area = error.mean_over_diameter * diameter_ / sqrt_area_;
  for (double& within : error.within) within /= compared;
  return error;
}

}  // namespace isomatch
