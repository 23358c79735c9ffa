#include "core/mesh/topology.h"

#include <algorithm>
#include <numeric>

#include "absl/types/span.h"
#include "core/base/sorted_buckets.h"
#include "core/mesh/mesh_geometry.h"
#include "core/mesh/vertex_stars.h"

namespace isomatch {
namespace {

/// One side of one face, of the edge from some vertex to a larger one.
struct KeyedSide {
  VertexIndex high;
  std::int64_t side;
  auto operator<=>(const KeyedSide&) const = default;
};

/// Calls visit(sides) with the sides of each edge, by increasing side.
template <typename Visit>
void ForEachEdge(const Faces& faces, const Visit& visit) {
  const auto ends = [&](std::int64_t side) {
    return std::minmax(faces(side / 3, side % 3),
                       faces(side / 3, (side % 3 + 1) % 3));
  };
  const VertexIndex num_vertices = faces.size() > 0 ? faces.maxCoeff() + 1 : 0;
  const SortedBuckets<KeyedSide> by_low(
      faces.size(), num_vertices,
      [&](std::int64_t side) { return ends(side).first; },
      [&](std::int64_t side) {
        return KeyedSide{ends(side).second, side};
      });
  for (VertexIndex low = 0; low < num_vertices; ++low) {
    absl::Span<const KeyedSide> left = by_low[low];
    while (!left.empty()) {
      std::size_t count = 1;
      while (count < left.size() && left[count].high == left[0].high) ++count;
      visit(left.first(count));
      left.remove_prefix(count);
    }
  }
}

/// Disjoint sets over 0..n-1; the root is the smallest member.
class DisjointSets {
 public:
  explicit DisjointSets(VertexIndex n) : parent_(n) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }
  VertexIndex Find(VertexIndex v) {
    while (parent_[v] != v) v = parent_[v] = parent_[parent_[v]];
    return v;
  }
  void Join(VertexIndex a, VertexIndex b) {
    const auto [low, high] = std::minmax({Find(a), Find(b)});
    parent_[high] = low;
  }

 private:
  std::vector<VertexIndex> parent_;
};

}  // namespace

EdgeFaces::EdgeFaces(const Faces& faces)
    : opposite_(3 * faces.rows(), kBoundary) {
  ForEachEdge(faces, [&](absl::Span<const KeyedSide> sides) {
    if (sides.size() == 2) {
      opposite_[sides[0].side] = sides[1].side;
      opposite_[sides[1].side] = sides[0].side;
      return;
    }
    if (sides.size() == 1) {
      ++boundary_edges_;
      return;
    }
    ++nonmanifold_edges_;
    for (const KeyedSide& side : sides) opposite_[side.side] = kNonManifold;
  });
}

Components ConnectedComponents(const TriangleMesh& mesh) {
  DisjointSets sets(mesh.num_vertices());
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    sets.Join(mesh.faces(f, 0), mesh.faces(f, 1));
    sets.Join(mesh.faces(f, 0), mesh.faces(f, 2));
  }
  Components components;
  components.of_vertex.resize(mesh.num_vertices());
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    const VertexIndex root = sets.Find(v);
    components.of_vertex[v] =
        root == v ? components.count++ : components.of_vertex[root];
  }
  return components;
}

std::vector<int> LargeComponents(const TriangleMesh& mesh,
                                 const Components& components) {
  constexpr double kSmall = 0.05;
  std::vector<double> areas(components.count, 0);
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    areas[components.of_vertex[mesh.faces(f, 0)]] += FaceArea(mesh, f);
  }
  std::vector<int> order(components.count);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return areas[a] > areas[b]; });
  const auto small = std::find_if(order.begin(), order.end(), [&](int c) {
    return areas[c] < kSmall * areas[order[0]];
  });
  order.erase(small, order.end());
  return order;
}

namespace {

/// The edges opposite v join its neighbors; a fan is one part of them.
bool HasOneFan(const TriangleMesh& mesh, const VertexStars& stars,
               VertexIndex v) {
  const auto neighbors = stars.Neighbors(v);
  DisjointSets link(static_cast<VertexIndex>(neighbors.size()));
  const auto position = [&](VertexIndex u) {
    return static_cast<VertexIndex>(
        std::lower_bound(neighbors.begin(), neighbors.end(), u) -
        neighbors.begin());
  };
  for (const VertexIndex f : stars.Faces(v)) {
    VertexIndex first = kNoVertex;
    for (int corner = 0; corner < 3; ++corner) {
      const VertexIndex u = mesh.faces(f, corner);
      if (u == v) continue;
      if (first == kNoVertex) {
        first = position(u);
      } else {
        link.Join(first, position(u));
      }
    }
  }
  for (VertexIndex u = 1; u < static_cast<VertexIndex>(neighbors.size()); ++u) {
    if (link.Find(u) != link.Find(0)) return false;
  }
  return true;
}

}  // namespace

std::vector<VertexIndex> NonManifoldVertices(const TriangleMesh& mesh) {
  const VertexStars stars(mesh);
  std::vector<VertexIndex> found;
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    if (!HasOneFan(mesh, stars, v)) found.push_back(v);
  }
  return found;
}

}  // namespace isomatch
