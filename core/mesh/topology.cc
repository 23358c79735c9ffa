#include "core/mesh/topology.h"

#include <algorithm>
#include <numeric>
#include <tuple>

#include "core/mesh/mesh_geometry.h"
#include "core/mesh/vertex_stars.h"

namespace isomatch {
namespace {

/// One side of one face, keyed by its edge without direction.
struct KeyedSide {
  VertexIndex low;
  VertexIndex high;
  std::int64_t side;
};

std::vector<KeyedSide> SidesByEdge(const Faces& faces) {
  std::vector<KeyedSide> sides;
  sides.reserve(3 * static_cast<std::size_t>(faces.rows()));
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    for (int corner = 0; corner < 3; ++corner) {
      const auto [low, high] =
          std::minmax({faces(f, corner), faces(f, (corner + 1) % 3)});
      sides.push_back({low, high, 3 * f + corner});
    }
  }
  std::sort(sides.begin(), sides.end(),
            [](const KeyedSide& a, const KeyedSide& b) {
              return std::tie(a.low, a.high, a.side) <
                     std::tie(b.low, b.high, b.side);
            });
  return sides;
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
  const std::vector<KeyedSide> sides = SidesByEdge(faces);
  for (std::size_t begin = 0, end = 0; begin < sides.size(); begin = end) {
    while (end < sides.size() && sides[end].low == sides[begin].low &&
           sides[end].high == sides[begin].high) {
      ++end;
    }
    if (end - begin == 1) ++boundary_edges_;
    if (end - begin > 2) {
      ++nonmanifold_edges_;
      for (std::size_t i = begin; i < end; ++i) {
        opposite_[sides[i].side] = kNonManifold;
      }
    }
    if (end - begin != 2) continue;
    opposite_[sides[begin].side] = sides[begin + 1].side;
    opposite_[sides[begin + 1].side] = sides[begin].side;
  }
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

/// The edges opposite v join its neighbours; a fan is one part of them.
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
