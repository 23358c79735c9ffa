#include "client/files/face_finder.h"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <utility>

#include "client/files/mesh_file.h"

namespace isomatch {
namespace {

VertexIndex Of(const VertexMap& map, VertexIndex vertex) {
  return map[static_cast<std::size_t>(vertex)];
}

std::array<VertexIndex, 3> Renamed(std::array<VertexIndex, 3> corners,
                                   const VertexMap& new_from_old) {
  for (VertexIndex& corner : corners) corner = Of(new_from_old, corner);
  return corners;
}

std::array<VertexIndex, 3> Sorted(std::array<VertexIndex, 3> corners) {
  std::sort(corners.begin(), corners.end());
  return corners;
}

VertexMap Identity(VertexIndex vertices) {
  VertexMap same(static_cast<std::size_t>(vertices));
  std::iota(same.begin(), same.end(), 0);
  return same;
}

/// The first vertex at each vertex's position, as a server sees them.
VertexMap FirstAtPosition(const TriangleMesh& mesh) {
  if (mesh.num_faces() == 0) return Identity(mesh.num_vertices());
  const Positions sent = AsSent(mesh).positions;
  const auto position = [&](VertexIndex v) {
    return std::array{sent(v, 0), sent(v, 1), sent(v, 2)};
  };
  VertexMap order = Identity(mesh.num_vertices());
  std::stable_sort(
      order.begin(), order.end(),
      [&](VertexIndex a, VertexIndex b) { return position(a) < position(b); });
  VertexMap first(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool is_new = i == 0 || position(order[i - 1]) != position(order[i]);
    first[static_cast<std::size_t>(order[i])] =
        is_new ? order[i] : Of(first, order[i - 1]);
  }
  return first;
}

/// The weights of `point` in the order of `face`, whose corners are the same.
SurfacePoint OnFace(VertexIndex face, const std::array<VertexIndex, 3>& corners,
                    const PrecisePoint& point,
                    const std::array<VertexIndex, 3>& named) {
  SurfacePoint found;
  found.face = face;
  for (std::size_t corner = 0; corner < 3; ++corner) {
    const auto position =
        std::find(named.begin(), named.end(), corners[corner]);
    found.weights[static_cast<Eigen::Index>(corner)] =
        point.weights[static_cast<std::size_t>(position - named.begin())];
  }
  return found;
}

}  // namespace

FaceFinder::FaceFinder(const TriangleMesh& mesh)
    : mesh_(mesh),
      same_(Identity(mesh.num_vertices())),
      first_(FirstAtPosition(mesh)),
      by_vertices_(MakeTable(same_)),
      by_positions_(MakeTable(first_)),
      face_at_(same_.size(), kNoVertex) {
  for (VertexIndex face = mesh.num_faces(); face-- > 0;) {
    for (const VertexIndex corner : Renamed(CornersOf(face), first_)) {
      face_at_[static_cast<std::size_t>(corner)] = face;
    }
  }
}

FaceFinder::Corners FaceFinder::CornersOf(VertexIndex face) const {
  return {mesh_.faces(face, 0), mesh_.faces(face, 1), mesh_.faces(face, 2)};
}

FaceFinder::Table FaceFinder::MakeTable(const VertexMap& new_from_old) const {
  Table table;
  table.reserve(static_cast<std::size_t>(mesh_.num_faces()));
  for (VertexIndex face = 0; face < mesh_.num_faces(); ++face) {
    const Corners corners = Sorted(Renamed(CornersOf(face), new_from_old));
    if (corners[0] == corners[1] || corners[1] == corners[2]) continue;
    table.emplace_back(corners, face);
  }
  std::sort(table.begin(), table.end());
  return table;
}

VertexIndex FaceFinder::Lookup(const Table& table, Corners corners) {
  corners = Sorted(corners);
  const auto found =
      std::lower_bound(table.begin(), table.end(), std::pair(corners, 0));
  return found == table.end() || found->first != corners ? kNoVertex
                                                         : found->second;
}

SurfacePoint FaceFinder::Find(const PrecisePoint& point) const {
  if (point.vertices[0] == kNoVertex) return {};
  for (const auto& [table, names] :
       {std::pair(&by_vertices_, &same_), std::pair(&by_positions_, &first_)}) {
    const Corners named = Renamed(point.vertices, *names);
    const VertexIndex face = Lookup(*table, named);
    if (face == kNoVertex) continue;
    return OnFace(face, Renamed(CornersOf(face), *names), point, named);
  }
  return AtHeaviestVertex(point);
}

SurfacePoint FaceFinder::AtHeaviestVertex(const PrecisePoint& point) const {
  const auto heaviest =
      std::max_element(point.weights.begin(), point.weights.end());
  const VertexIndex first = Of(first_, point.vertices[static_cast<std::size_t>(
                                           heaviest - point.weights.begin())]);
  SurfacePoint found;
  found.face = face_at_[static_cast<std::size_t>(first)];
  if (found.face == kNoVertex) return found;
  const Corners corners = Renamed(CornersOf(found.face), first_);
  found.weights[std::find(corners.begin(), corners.end(), first) -
                corners.begin()] = 1;
  return found;
}

}  // namespace isomatch
