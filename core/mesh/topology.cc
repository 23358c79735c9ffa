#include "core/mesh/topology.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include "absl/types/span.h"
#include "core/base/sorted_buckets.h"
#include "core/mesh/disjoint_sets.h"
#include "core/mesh/mesh_geometry.h"
#include "core/mesh/vertex_stars.h"

namespace isomatch {
namespace {

/// One side of one face, of the edge from some vertex to a larger one.
struct KeyedSide {
  VertexIndex high;
  std::int32_t side;
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
        return KeyedSide{ends(side).second, static_cast<std::int32_t>(side)};
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

std::vector<char> RimVertices(const TriangleMesh& mesh, const EdgeFaces& edges,
                              bool nonmanifold) {
  std::vector<char> is_on_rim(mesh.num_vertices(), false);
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    for (int corner = 0; corner < 3; ++corner) {
      if (nonmanifold ? edges.Opposite(f, corner).face != kNoVertex
                      : !edges.IsBoundary(f, corner)) {
        continue;
      }
      is_on_rim[mesh.faces(f, corner)] = true;
      is_on_rim[mesh.faces(f, (corner + 1) % 3)] = true;
    }
  }
  return is_on_rim;
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
  if (components.count == 1) return {0};
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

/// Counts the fans at each vertex, walking around it from face to face.
class FanCounter {
 public:
  FanCounter(const TriangleMesh& mesh, const EdgeFaces& edges)
      : faces_(mesh.faces),
        edges_(edges),
        visited_(3 * std::int64_t{mesh.num_faces()}, false),
        fans_(mesh.num_vertices(), 0) {
    for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
      for (int corner = 0; corner < 3; ++corner) {
        if (Visit(f, corner)) CountFan(f, corner);
      }
    }
  }

  /// Of each vertex, two standing for more; those that share a non-manifold
  /// edge are counted apart.
  const std::vector<char>& fans() const { return fans_; }

 private:
  /// Whether it is for the first time.
  bool Visit(VertexIndex face, int corner) {
    char& visited = visited_[3 * std::int64_t{face} + corner];
    const bool first = !visited;
    visited = true;
    return first;
  }

  void CountFan(VertexIndex face, int corner) {
    const VertexIndex vertex = faces_(face, corner);
    fans_[vertex] = static_cast<char>(std::min(fans_[vertex] + 1, 2));
    // Over the side that begins at the vertex, then over the one that ends.
    for (int side : {corner, (corner + 2) % 3}) {
      VertexIndex f = face;
      while (true) {
        const EdgeFaces::Side other = edges_.Opposite(f, side);
        if (other.face == kNoVertex) break;
        const int at = faces_(other.face, other.corner) == vertex
                           ? other.corner
                           : (other.corner + 1) % 3;
        if (!Visit(other.face, at)) break;
        f = other.face;
        side = at == other.corner ? (at + 2) % 3 : at;
      }
    }
  }

  const Faces& faces_;
  const EdgeFaces& edges_;
  std::vector<char> visited_;  ///< by corner
  std::vector<char> fans_;
};

}  // namespace

std::vector<VertexIndex> NonManifoldVertices(const TriangleMesh& mesh,
                                             const EdgeFaces& edges) {
  std::vector<VertexIndex> found;
  const std::vector<char> fans = FanCounter(mesh, edges).fans();
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    if (fans[v] > 1) found.push_back(v);
  }
  if (found.empty()) return found;
  // Fans that share a non-manifold edge are one.
  const VertexStars stars(mesh);
  std::erase_if(found,
                [&](VertexIndex v) { return HasOneFan(mesh, stars, v); });
  return found;
}

}  // namespace isomatch
