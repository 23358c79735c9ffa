#include "core/mesh/component_topology.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "core/mesh/mesh_geometry.h"
#include "core/mesh/topology.h"

namespace isomatch {
namespace {

using Side = EdgeFaces::Side;

/// The other side of the side's face that ends at `vertex`.
Side OtherSideAt(const Faces& faces, Side side, VertexIndex vertex) {
  for (int step = 1; step < 3; ++step) {
    const int corner = (side.corner + step) % 3;
    if (faces(side.face, corner) == vertex ||
        faces(side.face, (corner + 1) % 3) == vertex) {
      return {side.face, corner};
    }
  }
  return side;
}

/// Follows the rims of a surface.
class RimWalker {
 public:
  RimWalker(const EdgeFaces& edges, const Faces& faces)
      : edges_(edges),
        faces_(faces),
        visited_(3 * static_cast<std::size_t>(faces.rows()), false) {}

  /// True when the side begins a rim that was not walked yet, and walks it.
  bool Walk(Side side) {
    if (!edges_.IsBoundary(side.face, side.corner) || Visited(side)) {
      return false;
    }
    VertexIndex tip = faces_(side.face, (side.corner + 1) % 3);
    while (edges_.IsBoundary(side.face, side.corner) && !Visited(side)) {
      visited_[Slot(side)] = true;
      side = NextAround(side, tip);
      const VertexIndex from = faces_(side.face, side.corner);
      tip = from == tip ? faces_(side.face, (side.corner + 1) % 3) : from;
    }
    return true;
  }

 private:
  static std::size_t Slot(Side side) {
    return 3 * static_cast<std::size_t>(side.face) +
           static_cast<std::size_t>(side.corner);
  }
  bool Visited(Side side) const { return visited_[Slot(side)]; }

  /// Turns around `vertex` from face to face until a side has no other face.
  Side NextAround(Side side, VertexIndex vertex) const {
    while (true) {
      side = OtherSideAt(faces_, side, vertex);
      const Side across = edges_.Opposite(side.face, side.corner);
      if (across.face == kNoVertex) return side;
      side = across;
    }
  }

  const EdgeFaces& edges_;
  const Faces& faces_;
  std::vector<bool> visited_;
};

/// Counts what the sides of faces tell: edges, rims, where faces disagree.
void AddSides(const TriangleMesh& mesh, const EdgeFaces& edges,
              const Components& components,
              std::vector<ComponentTopology>* found) {
  RimWalker rims(edges, mesh.faces);
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    ComponentTopology& component =
        (*found)[components.of_vertex[mesh.faces(f, 0)]];
    for (int corner = 0; corner < 3; ++corner) {
      const Side other = edges.Opposite(f, corner);
      component.boundary_loops += rims.Walk({f, corner});
      if (other.face == kNoVertex) {
        component.is_manifold &= edges.IsBoundary(f, corner);
        component.euler_characteristic -= edges.IsBoundary(f, corner);
        continue;
      }
      component.euler_characteristic -= f < other.face;
      component.is_oriented &=
          mesh.faces(f, corner) != mesh.faces(other.face, other.corner);
    }
  }
}

/// Takes off one for each edge at which three or more faces meet.
void TakeNonManifoldEdges(const TriangleMesh& mesh, const EdgeFaces& edges,
                          const Components& components,
                          std::vector<ComponentTopology>* found) {
  if (edges.nonmanifold_edges() == 0) return;
  std::vector<std::pair<VertexIndex, VertexIndex>> met;
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    for (int corner = 0; corner < 3; ++corner) {
      if (edges.Opposite(f, corner).face != kNoVertex ||
          edges.IsBoundary(f, corner)) {
        continue;
      }
      met.push_back(std::minmax(
          {mesh.faces(f, corner), mesh.faces(f, (corner + 1) % 3)}));
    }
  }
  std::sort(met.begin(), met.end());
  met.erase(std::unique(met.begin(), met.end()), met.end());
  for (const auto& [low, high] : met) {
    --(*found)[components.of_vertex[low]].euler_characteristic;
  }
}

}  // namespace

std::optional<std::int64_t> ComponentTopology::Genus() const {
  if (!is_manifold || !is_oriented) return std::nullopt;
  return (2 - euler_characteristic - boundary_loops) / 2;
}

std::vector<ComponentTopology> DescribeComponents(const TriangleMesh& mesh) {
  const Components components = ConnectedComponents(mesh);
  std::vector<ComponentTopology> found(components.count);
  for (const int component : components.of_vertex) {
    ++found[component].vertices;
    ++found[component].euler_characteristic;
  }
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    ComponentTopology& component =
        found[components.of_vertex[mesh.faces(f, 0)]];
    ++component.faces;
    ++component.euler_characteristic;
    component.area += FaceArea(mesh, f);
  }
  const EdgeFaces edges(mesh.faces);
  AddSides(mesh, edges, components, &found);
  TakeNonManifoldEdges(mesh, edges, components, &found);
  for (const VertexIndex v : NonManifoldVertices(mesh, edges)) {
    found[components.of_vertex[v]].is_manifold = false;
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const ComponentTopology& a, const ComponentTopology& b) {
                     return a.area > b.area;
                   });
  return found;
}

}  // namespace isomatch
