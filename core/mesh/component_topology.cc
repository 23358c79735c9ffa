#include "core/mesh/component_topology.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "core/mesh/mesh_geometry.h"
#include "core/mesh/rim_walker.h"
#include "core/mesh/topology.h"

namespace isomatch {
namespace {

/// Counts what the sides of faces tell: edges, rims, where faces disagree.
void AddSides(const TriangleMesh& mesh, const EdgeFaces& edges,
              const Components& components,
              std::vector<ComponentTopology>* found) {
  RimWalker rims(edges, mesh.faces);
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    ComponentTopology& component =
        (*found)[components.of_vertex[mesh.faces(f, 0)]];
    for (int corner = 0; corner < 3; ++corner) {
      const EdgeFaces::Side other = edges.Opposite(f, corner);
      component.boundary_loops += !rims.Walk({f, corner}).empty();
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
