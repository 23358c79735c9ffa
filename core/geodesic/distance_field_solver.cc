#include "core/geodesic/distance_field_solver.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <utility>

#include "core/mesh/mesh_geometry.h"

namespace isomatch {
namespace {

/// Buckets in the ring. A longer edge than the ring waits in its last bucket
/// and is sorted in again from there.
constexpr std::int64_t kBuckets = 256;
/// As a fraction of the mean edge length: narrow enough that few vertices are
/// corrected, wide enough that few buckets are empty.
constexpr double kBucketWidth = 0.5;
/// As a fraction of the mean edge length: a smaller correction is rounding.
constexpr double kTolerance = 1e-6;

/// Entries a vertex, over all vertices, after which only ways along edges
/// count: where rounding makes triangles of no plane, sources in their planes
/// come ever nearer, round and round. Sound meshes take 1 to 3.
constexpr std::int64_t kMostEntries = 64;

/// Entries a vertex of one bucket beyond which those that were corrected go.
constexpr std::size_t kCrowded = 2;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Distance of the target when the front crosses its stencil's base; infinite
/// when the straight line misses the base or no such source exists.
double PointSourceDistance(const WavefrontStencil& stencil, double from_support,
                           double from_other) {
  const double base = stencil.base;
  const double x = 0.5 * (base + (from_support - from_other) *
                                     (from_support + from_other) / base);
  const double y_squared = from_support * from_support - x * x;
  if (!(y_squared >= 0)) return kInfinity;
  const double y = std::sqrt(y_squared);
  const double across = stencil.target_x - x;
  const double down = stencil.target_y + y;
  const double crossing = x * down + across * y;
  if (!(crossing >= 0 && crossing <= base * down)) return kInfinity;
  return std::sqrt(across * across + down * down);
}

}  // namespace

DistanceFieldSolver::DistanceFieldSolver(const TriangleMesh& mesh,
                                         std::stop_token stop)
    : stencils_(mesh), stop_(std::move(stop)) {
  const double mean_edge = MeanEdgeLength(mesh);
  assert(mean_edge > 0);
  bucket_width_ = kBucketWidth * mean_edge;
  tolerance_ = kTolerance * mean_edge;
}

void DistanceFieldSolver::Push(VertexIndex vertex, double distance,
                               std::int64_t bucket,
                               Workspace* workspace) const {
  const std::int64_t last = bucket + kBuckets - 1;
  const double position = distance / bucket_width_;
  const std::int64_t wanted =
      position < static_cast<double>(last)
          ? std::max(bucket, static_cast<std::int64_t>(position))
          : last;
  auto& entries = workspace->buckets[wanted % kBuckets];
  if (wanted != bucket && IsCrowded(entries)) Thin(0, &entries, workspace);
  entries.emplace_back(distance, vertex);
  ++workspace->entries;
}

bool DistanceFieldSolver::IsCrowded(const std::vector<Entry>& entries) const {
  return entries.size() > kCrowded * static_cast<std::size_t>(num_vertices());
}

void DistanceFieldSolver::Thin(std::size_t done, std::vector<Entry>* entries,
                               Workspace* workspace) {
  const auto begin = entries->begin() + static_cast<std::ptrdiff_t>(done);
  entries->erase(std::remove_if(begin, entries->end(),
                                [&](const Entry& entry) {
                                  return entry.first >
                                         workspace->distances[entry.second];
                                }),
                 entries->end());
  entries->erase(entries->begin(), begin);
}

void DistanceFieldSolver::Relax(VertexIndex support, double distance,
                                std::int64_t bucket,
                                Workspace* workspace) const {
  std::vector<double>& distances = workspace->distances;
  const bool over_planes = workspace->entries < kMostEntries * num_vertices();
  const WavefrontStencil* const end = stencils_.end(support);
  for (const WavefrontStencil* s = stencils_.begin(support); s != end; ++s) {
    const double current = distances[s->target];
    const double from_other = distances[s->other];
    // A front comes from at least one end that is nearer.
    if (current <= std::min(distance, from_other)) continue;
    double candidate = distance + s->edge;
    if (over_planes && from_other < kInfinity) {
      candidate =
          std::min(candidate, PointSourceDistance(*s, distance, from_other));
    }
    if (!(candidate < current - tolerance_)) continue;
    if (current == kInfinity) workspace->touched.push_back(s->target);
    distances[s->target] = candidate;
    Push(s->target, candidate, bucket, workspace);
  }
}

void DistanceFieldSolver::Reset(Workspace* workspace) const {
  workspace->buckets.resize(kBuckets);
  if (workspace->distances.size() != static_cast<std::size_t>(num_vertices())) {
    workspace->distances.assign(num_vertices(), kInfinity);
    workspace->touched.clear();
  }
  for (const VertexIndex v : workspace->touched) {
    workspace->distances[v] = kInfinity;
  }
  workspace->touched.clear();
  workspace->entries = 0;
  for (auto& bucket : workspace->buckets) bucket.clear();
}

template <typename Visitor, typename Finished>
void DistanceFieldSolver::Propagate(VertexIndex source, const Visitor& visit,
                                    const Finished& finished,
                                    Workspace* workspace) const {
  Reset(workspace);
  workspace->distances[source] = 0;
  workspace->touched.push_back(source);
  Push(source, 0, 0, workspace);
  std::int64_t empty_in_a_row = 0;
  for (std::int64_t bucket = 0; empty_in_a_row < kBuckets; ++bucket) {
    if (stop_.stop_requested()) return;
    auto& entries = workspace->buckets[bucket % kBuckets];
    empty_in_a_row = entries.empty() ? empty_in_a_row + 1 : 0;
    // Relaxing may append to this bucket while it is worked off.
    for (std::size_t i = 0; i < entries.size(); ++i) {
      if (IsCrowded(entries)) {
        Thin(i, &entries, workspace);
        if (entries.empty()) break;
        i = 0;
      }
      const auto [distance, vertex] = entries[i];  // a copy: it may move
      if (distance > workspace->distances[vertex]) continue;  // corrected
      if (distance / bucket_width_ >= static_cast<double>(bucket + 1)) {
        Push(vertex, distance, bucket, workspace);  // waited in the last
        continue;
      }
      if (visit(vertex, distance) == Visit::kPrune) continue;
      Relax(vertex, distance, bucket, workspace);
    }
    entries.clear();
    if (finished(static_cast<double>(bucket + 1) * bucket_width_)) return;
  }
}

void DistanceFieldSolver::Solve(VertexIndex source, float* field,
                                std::int64_t stride,
                                Workspace* workspace) const {
  Propagate(
      source, [](VertexIndex, double) { return Visit::kContinue; },
      [](double) { return false; }, workspace);
  for (VertexIndex v = 0; v < num_vertices(); ++v) {
    const double distance = workspace->distances[v];
    field[v * stride] =
        distance < kInfinity ? static_cast<float>(distance) : kUnreachable;
  }
}

void DistanceFieldSolver::Lower(VertexIndex source, absl::Span<float> nearest,
                                Workspace* workspace) const {
  const auto lower = [&](VertexIndex v, double distance) {
    if (distance > nearest[v]) return Visit::kPrune;
    nearest[v] = static_cast<float>(distance);
    return Visit::kContinue;
  };
  Propagate(
      source, lower, [](double) { return false; }, workspace);
}

void DistanceFieldSolver::SolveTo(VertexIndex source,
                                  absl::Span<const VertexIndex> targets,
                                  absl::Span<float> distances,
                                  Workspace* workspace) const {
  const auto passed = [&](double front) {
    return std::all_of(targets.begin(), targets.end(), [&](VertexIndex t) {
      return workspace->distances[t] < front;
    });
  };
  Propagate(
      source, [](VertexIndex, double) { return Visit::kContinue; }, passed,
      workspace);
  for (std::size_t i = 0; i < targets.size(); ++i) {
    const double distance = workspace->distances[targets[i]];
    distances[i] =
        distance < kInfinity ? static_cast<float>(distance) : kUnreachable;
  }
}

}  // namespace isomatch
