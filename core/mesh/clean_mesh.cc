#include "core/mesh/clean_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/parallel.h"
#include "core/base/sorted_buckets.h"
#include "core/base/status_macros.h"
#include "core/mesh/mesh_geometry.h"
#include "core/mesh/spatial_order.h"
#include "core/mesh/topology.h"

namespace isomatch {
namespace {

/// For each vertex the smallest vertex that is the same point: of the same
/// coordinates, both on a boundary. Where closed surfaces merely touch, as
/// fingers do, they stay apart.
VertexMap WeldSeams(const TriangleMesh& mesh, const EdgeFaces& edges) {
  const Positions& positions = mesh.positions;
  const std::vector<char> on_boundary =
      RimVertices(mesh, edges, /*nonmanifold=*/true);
  VertexMap welded(positions.rows());
  std::iota(welded.begin(), welded.end(), 0);
  VertexMap order;
  for (const VertexIndex v : welded) {
    if (on_boundary[v]) order.push_back(v);
  }
  const auto key = [&](VertexIndex v) {
    return std::array<double, 3>{positions(v, 0), positions(v, 1),
                                 positions(v, 2)};
  };
  std::sort(order.begin(), order.end(), [&](VertexIndex a, VertexIndex b) {
    return std::pair(key(a), a) < std::pair(key(b), b);
  });
  for (std::size_t i = 1; i < order.size(); ++i) {
    if (key(order[i]) == key(order[i - 1])) {
      welded[order[i]] = welded[order[i - 1]];
    }
  }
  return welded;
}

bool IsIdentity(const VertexMap& map) {
  for (std::size_t v = 0; v < map.size(); ++v) {
    if (map[v] != static_cast<VertexIndex>(v)) return false;
  }
  return true;
}

/// Height over length of a face below which it is a sliver.
constexpr double kSliver = 0.01;

/// A face as a set of vertices, but its smallest, to find repetitions.
struct FaceKey {
  VertexIndex middle;
  VertexIndex largest;
  VertexIndex face;
  auto operator<=>(const FaceKey&) const = default;
};

/// Marks faces that repeat a vertex or an earlier face.
std::vector<bool> Superfluous(const Faces& faces, VertexIndex num_vertices) {
  const auto sorted = [&](std::int64_t f) {
    std::array<VertexIndex, 3> face = {faces(f, 0), faces(f, 1), faces(f, 2)};
    std::sort(face.begin(), face.end());
    return face;
  };
  const SortedBuckets<FaceKey> by_smallest(
      faces.rows(), num_vertices, [&](std::int64_t f) { return sorted(f)[0]; },
      [&](std::int64_t f) {
        const auto [smallest, middle, largest] = sorted(f);
        return FaceKey{middle, largest, static_cast<VertexIndex>(f)};
      });
  std::vector<bool> superfluous(faces.rows(), false);
  for (VertexIndex v = 0; v < num_vertices; ++v) {
    const FaceKey* before = nullptr;
    for (const FaceKey& key : by_smallest[v]) {
      const bool repeats = before != nullptr && before->middle == key.middle &&
                           before->largest == key.largest;
      superfluous[key.face] =
          key.middle == v || key.middle == key.largest || repeats;
      before = &key;
    }
  }
  return superfluous;
}

/// Faces over welded vertices, without superfluous ones; `dropped` counts
/// those.
Faces WeldedFaces(const Faces& faces, const VertexMap& welded,
                  VertexIndex* dropped) {
  Faces kept = faces;
  for (Eigen::Index i = 0; i < kept.size(); ++i) {
    kept.data()[i] = welded[kept.data()[i]];
  }
  const std::vector<bool> superfluous =
      Superfluous(kept, static_cast<VertexIndex>(welded.size()));
  Eigen::Index count = 0;
  for (Eigen::Index f = 0; f < kept.rows(); ++f) {
    if (superfluous[f]) continue;
    if (f != count) kept.row(count) = kept.row(f);
    ++count;
  }
  *dropped = static_cast<VertexIndex>(faces.rows() - count);
  kept.conservativeResize(count, Eigen::NoChange);
  return kept;
}

/// Renumbers the vertices that are on a face, in their old order.
void Compact(const TriangleMesh& mesh, const VertexMap& welded,
             CleanMesh* clean) {
  Faces& faces = clean->mesh.faces;
  VertexMap new_from_old(mesh.num_vertices(), kNoVertex);
  for (Eigen::Index i = 0; i < faces.size(); ++i) {
    new_from_old[faces.data()[i]] = 0;
  }
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    if (new_from_old[v] == kNoVertex) continue;
    new_from_old[v] =
        static_cast<VertexIndex>(clean->original_from_clean.size());
    clean->original_from_clean.push_back(v);
  }
  for (Eigen::Index i = 0; i < faces.size(); ++i) {
    faces.data()[i] = new_from_old[faces.data()[i]];
  }
  clean->clean_from_original.resize(mesh.num_vertices());
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    clean->clean_from_original[v] = new_from_old[welded[v]];
  }
  clean->mesh.positions.resize(clean->original_from_clean.size(), 3);
  for (std::size_t v = 0; v < clean->original_from_clean.size(); ++v) {
    clean->mesh.positions.row(v) =
        mesh.positions.row(clean->original_from_clean[v]);
  }
}

/// Flood fill of one patch of faces that hang together over manifold edges.
class PatchOrienter {
 public:
  PatchOrienter(const EdgeFaces& edges, TriangleMesh* mesh)
      : edges_(edges),
        mesh_(*mesh),
        visited_(mesh->num_faces(), false),
        flip_(mesh->num_faces(), false) {}

  bool visited(VertexIndex face) const { return visited_[face]; }
  bool consistent() const { return consistent_; }
  VertexIndex flipped() const { return flipped_; }

  /// Orients the patch of `seed` like `seed`, then outwards.
  void OrientPatch(VertexIndex seed) {
    CollectPatch(seed);
    Eigen::RowVector3d center = Eigen::RowVector3d::Zero();
    for (const VertexIndex f : patch_) {
      center += mesh_.positions.row(mesh_.faces(f, 0)) / double(patch_.size());
    }
    double volume = 0;
    double area = 0;
    for (const VertexIndex f : patch_) {
      volume += (flip_[f] ? -1 : 1) * SignedVolume6(mesh_, f, center);
      area += FaceArea(mesh_, f);
    }
    // A flat sheet encloses nothing: it keeps the file's orientation.
    const bool inside_out = volume < -kFlatVolume * area * std::sqrt(area);
    for (const VertexIndex f : patch_) {
      if (flip_[f] == inside_out) continue;
      std::swap(mesh_.faces(f, 1), mesh_.faces(f, 2));
      ++flipped_;
    }
  }

 private:
  void CollectPatch(VertexIndex seed) {
    patch_.assign(1, seed);
    visited_[seed] = true;
    for (std::size_t i = 0; i < patch_.size(); ++i) {
      for (int corner = 0; corner < 3; ++corner) Visit(patch_[i], corner);
    }
  }

  void Visit(VertexIndex face, int corner) {
    const EdgeFaces::Side other = edges_.Opposite(face, corner);
    if (other.face == kNoVertex) return;
    // Faces agree when they run through their edge in opposite directions.
    const bool same_direction =
        mesh_.faces(face, corner) == mesh_.faces(other.face, other.corner);
    const bool flip = flip_[face] != same_direction;
    if (visited_[other.face]) {
      if (flip_[other.face] != flip) consistent_ = false;
      return;
    }
    visited_[other.face] = true;
    flip_[other.face] = flip;
    patch_.push_back(other.face);
  }

  const EdgeFaces& edges_;
  TriangleMesh& mesh_;
  std::vector<bool> visited_;
  std::vector<bool> flip_;
  std::vector<VertexIndex> patch_;
  bool consistent_ = true;
  VertexIndex flipped_ = 0;
};

void OrientOutwards(const EdgeFaces& edges, CleanMesh* clean) {
  PatchOrienter orienter(edges, &clean->mesh);
  for (VertexIndex f = 0; f < clean->mesh.num_faces(); ++f) {
    if (!orienter.visited(f)) orienter.OrientPatch(f);
  }
  clean->oriented = orienter.consistent();
  const auto warn = [&](const std::string& text) {
    clean->warnings.push_back(text);
  };
  if (!clean->oriented) warn("the surface has no consistent orientation");
  if (orienter.flipped() > 0) {
    warn(absl::StrCat(orienter.flipped(), " faces turned to point outwards"));
  }
  if (edges.nonmanifold_edges() > 0) {
    warn(absl::StrCat(edges.nonmanifold_edges(), " non-manifold edges"));
  }
  if (edges.boundary_edges() > 0) {
    warn(absl::StrCat("open surface, ", edges.boundary_edges(),
                      " boundary edges"));
  }
}

/// Vertices from which on the order of a mesh is worth a copy.
constexpr VertexIndex kWorthOrdering = 1 << 16;

/// The vertices in `order`, and the faces by their first one.
TriangleMesh Renumbered(const TriangleMesh& mesh, const VertexMap& order) {
  VertexMap place(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    place[order[i]] = static_cast<VertexIndex>(i);
  }
  const SortedBuckets<VertexIndex> by_first(
      mesh.num_faces(), mesh.num_vertices(),
      [&](std::int64_t f) { return place[mesh.faces(f, 0)]; },
      [](std::int64_t f) { return static_cast<VertexIndex>(f); });
  TriangleMesh renumbered = {mesh.positions(order, Eigen::all),
                             Faces(mesh.num_faces(), 3)};
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    for (int corner = 0; corner < 3; ++corner) {
      renumbered.faces(f, corner) =
          place[mesh.faces(by_first.items()[f], corner)];
    }
  }
  return renumbered;
}

void WarnOfSlivers(CleanMesh* clean) {
  const TriangleMesh& mesh = clean->mesh;
  VertexIndex flat = 0;
  VertexIndex slivers = 0;
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    const FaceExtent extent = ExtentOf(mesh, f);
    flat += extent.is_flat();
    slivers += !extent.is_flat() && extent.height < kSliver * extent.longest;
  }
  const auto warn = [&](VertexIndex count, const char* text) {
    if (count > 0) clean->warnings.push_back(absl::StrCat(count, text));
  };
  warn(flat, " faces of no area");
  warn(slivers, " sliver faces, a hundred times longer than high");
}

void WarnOfVertices(const VertexMap& welded, VertexIndex dropped_faces,
                    const EdgeFaces& edges, CleanMesh* clean) {
  VertexIndex duplicates = 0;
  VertexIndex isolated = 0;
  for (std::size_t v = 0; v < welded.size(); ++v) {
    const bool on_face = clean->clean_from_original[v] != kNoVertex;
    isolated += !on_face;
    duplicates += on_face && welded[v] != static_cast<VertexIndex>(v);
  }
  const auto warn = [&](VertexIndex count, const char* text) {
    if (count > 0) clean->warnings.push_back(absl::StrCat(count, text));
  };
  warn(duplicates,
       " vertices along seams coincide with others and were joined");
  warn(isolated, " vertices are on no face and stay unmatched");
  warn(dropped_faces, " degenerate or repeated faces left out");
  warn(static_cast<VertexIndex>(NonManifoldVertices(clean->mesh, edges).size()),
       " non-manifold vertices");
  WarnOfSlivers(clean);
  const int components = ConnectedComponents(clean->mesh).count;
  if (components > 1) warn(components, " separate components");
}

}  // namespace

absl::StatusOr<CleanMesh> Clean(const TriangleMesh& mesh,
                                const std::stop_token& stop) {
  ISOMATCH_RETURN_IF_ERROR(CheckNotCancelled(stop));
  CleanMesh clean;
  std::optional<EdgeFaces> edges(mesh.faces);
  const VertexMap welded = WeldSeams(mesh, *edges);
  ISOMATCH_RETURN_IF_ERROR(CheckNotCancelled(stop));
  VertexIndex dropped = 0;
  clean.mesh.faces = WeldedFaces(mesh.faces, welded, &dropped);
  Compact(mesh, welded, &clean);
  ISOMATCH_RETURN_IF_ERROR(CheckNotCancelled(stop));
  // Where nothing was joined or dropped, the same sides meet as before.
  if (dropped > 0 || !IsIdentity(welded)) edges.emplace(clean.mesh.faces);
  WarnOfVertices(welded, dropped, *edges, &clean);
  ISOMATCH_RETURN_IF_ERROR(CheckNotCancelled(stop));
  OrientOutwards(*edges, &clean);
  return clean;
}

CleanMesh Clean(const TriangleMesh& mesh) { return *Clean(mesh, {}); }

absl::StatusOr<CleanMesh> CleanInSpatialOrder(const TriangleMesh& mesh,
                                              const std::stop_token& stop) {
  if (mesh.num_vertices() < kWorthOrdering) return Clean(mesh, stop);
  const VertexMap order = SpatialOrder(mesh.positions);
  ISOMATCH_RETURN_IF_ERROR(CheckNotCancelled(stop));
  ISOMATCH_ASSIGN_OR_RETURN(CleanMesh clean,
                            Clean(Renumbered(mesh, order), stop));
  for (VertexIndex& v : clean.original_from_clean) v = order[v];
  VertexMap clean_from_original(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    clean_from_original[order[i]] = clean.clean_from_original[i];
  }
  clean.clean_from_original = std::move(clean_from_original);
  return clean;
}

}  // namespace isomatch
