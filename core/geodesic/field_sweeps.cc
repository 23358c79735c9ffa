#include "core/geodesic/field_sweeps.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <utility>

namespace isomatch {
namespace {

/// Updates a vertex, over all vertices, after which only ways along edges
/// count, as in DistanceFieldSolver. Sound meshes take 9 to 32.
constexpr std::int64_t kMostUpdates = 256;

float MeanEdge(const WavefrontStencils& stencils) {
  double sum = 0;
  for (VertexIndex v = 0; v < stencils.num_vertices(); ++v) {
    for (auto s = stencils.begin(v); s != stencils.end(v); ++s) sum += s->edge;
  }
  return sum > 0 ? static_cast<float>(sum / double(stencils.size())) : 1;
}

}  // namespace

FieldSweeps::FieldSweeps(const WavefrontStencils& stencils, float least_change)
    : scale_(MeanEdge(stencils)),
      kept_(1 - least_change),
      first_(stencils.num_vertices() + 1, 0),
      first_after_(stencils.num_vertices() + 1, 0) {
  // Each triangle has a stencil from either end; one of them is enough.
  const auto for_each = [&](const auto& visit) {
    for (VertexIndex v = 0; v < stencils.num_vertices(); ++v) {
      for (auto s = stencils.begin(v); s != stencils.end(v); ++s) {
        if (v < s->other) visit(v, *s);
      }
    }
  };
  for_each(
      [&](VertexIndex, const WavefrontStencil& s) { ++first_[s.target + 1]; });
  std::partial_sum(first_.begin(), first_.end(), first_.begin());
  triangles_.resize(first_.back());
  std::vector<std::int64_t> next(first_.begin(), first_.end() - 1);
  for_each([&](VertexIndex v, const WavefrontStencil& s) {
    triangles_[next[s.target]++] = {
        .a = v,
        .b = s.other,
        .base = s.base / scale_,
        .inverse_base = scale_ / s.base,
        .x = s.target_x / scale_,
        .y = s.target_y / scale_,
        .from_a = s.edge / scale_,
        .from_b = std::hypot(s.base - s.target_x, s.target_y) / scale_};
  });
  std::vector<VertexIndex> targets;
  for (VertexIndex v = 0; v < stencils.num_vertices(); ++v) {
    targets.clear();
    for (auto s = stencils.begin(v); s != stencils.end(v); ++s) {
      targets.push_back(s->target);
    }
    std::ranges::sort(targets);
    after_.insert(after_.end(), targets.begin(),
                  std::unique(targets.begin(), targets.end()));
    first_after_[v + 1] = static_cast<std::int64_t>(after_.size());
  }
}

void FieldSweeps::OrderFrom(VertexIndex source, Workspace* workspace) const {
  std::vector<VertexIndex>& order = workspace->order;
  std::vector<std::int32_t>& edges = workspace->edges;
  edges.assign(num_vertices(), -1);
  edges[source] = 0;
  order.assign(1, source);
  for (std::size_t i = 0; i < order.size(); ++i) {
    const VertexIndex v = order[i];
    for (auto k = first_after_[v]; k < first_after_[v + 1]; ++k) {
      if (edges[after_[k]] >= 0) continue;
      edges[after_[k]] = edges[v] + 1;
      order.push_back(after_[k]);
    }
  }
}

std::vector<std::vector<int>> FieldSweeps::Groups(
    absl::Span<const VertexIndex> sources) const {
  std::vector<int> left(sources.size());
  std::iota(left.begin(), left.end(), 0);
  std::vector<std::vector<int>> groups;
  Workspace workspace;
  while (!left.empty()) {
    OrderFrom(sources[left.front()], &workspace);
    const auto edges = [&](int z) { return workspace.edges[sources[z]]; };
    const std::size_t most = std::min<std::size_t>(kLanes, left.size());
    // Those of other components come last.
    std::ranges::partial_sort(
        left, left.begin() + most, std::less<>(), [&](int z) {
          return std::pair(static_cast<std::uint32_t>(edges(z)), z);
        });
    std::size_t size = 1;
    while (size < most && edges(left[size]) >= 0) ++size;
    groups.emplace_back(left.begin(), left.begin() + size);
    left.erase(left.begin(), left.begin() + size);
    std::ranges::sort(left);
  }
  return groups;
}

bool FieldSweeps::Update(VertexIndex vertex, bool over_planes,
                         float* distances) const {
  float* const own = distances + std::int64_t{vertex} * kLanes;
  const Lanes before = LoadLanes(own);
  const Lanes zero = {};
  const Lanes infinite = AllLanes(std::numeric_limits<float>::infinity());
  Lanes now = before;
  // Squares, since the least root is the root of the least.
  Lanes over_plane = infinite;
  for (auto i = first_[vertex]; i < first_[vertex + 1]; ++i) {
    const Triangle& t = triangles_[i];
    const Lanes a = LoadLanes(distances + std::int64_t{t.a} * kLanes);
    const Lanes b = LoadLanes(distances + std::int64_t{t.b} * kLanes);
    now = MinLanes(now, MinLanes(a + t.from_a, b + t.from_b));
    if (!over_planes) continue;
    // The virtual source, and where its straight line crosses the edge.
    const Lanes x = 0.5f * (t.base + (a - b) * (a + b) * t.inverse_base);
    const Lanes y_squared = a * a - x * x;
    const Lanes y = SqrtLanes(y_squared > zero ? y_squared : zero);
    const Lanes across = t.x - x;
    const Lanes down = t.y + y;
    const Lanes crossing = x * down + across * y;
    const auto hits =
        (y_squared >= zero) & (crossing >= zero) & (crossing <= t.base * down);
    over_plane =
        MinLanes(over_plane, hits ? across * across + down * down : infinite);
  }
  now = MinLanes(now, SqrtLanes(over_plane));
  if (!AnyLane(now < before * kept_)) return false;
  StoreLanes(now, own);
  return true;
}

void FieldSweeps::SetWaiting(VertexIndex changed,
                             std::vector<char>* waiting) const {
  for (auto k = first_after_[changed]; k < first_after_[changed + 1]; ++k) {
    (*waiting)[after_[k]] = 1;
  }
}

void FieldSweeps::Solve(absl::Span<const VertexIndex> sources,
                        absl::Span<const int> group,
                        const std::stop_token& stop,
                        Workspace* workspace) const {
  OrderFrom(sources[group.front()], workspace);
  std::vector<float>& distances = workspace->distances;
  std::vector<char>& waiting = workspace->waiting;
  distances.assign(std::size_t{kLanes} * num_vertices(), kFar);
  waiting.assign(num_vertices(), 0);
  for (std::size_t lane = 0; lane < group.size(); ++lane) {
    const VertexIndex source = sources[group[lane]];
    distances[std::size_t{kLanes} * source + lane] = 0;
    SetWaiting(source, &waiting);
  }
  std::int64_t left = kMostUpdates * num_vertices();
  for (bool changed = true; changed && !stop.stop_requested();) {
    changed = false;
    for (const VertexIndex v : workspace->order) {
      if (!waiting[v]) continue;
      waiting[v] = 0;
      if (!Update(v, --left >= 0, distances.data())) continue;
      SetWaiting(v, &waiting);
      changed = true;
    }
  }
}

}  // namespace isomatch
