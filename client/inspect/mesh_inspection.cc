#include "client/inspect/mesh_inspection.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/files/mesh_file.h"
#include "core/base/status_macros.h"
#include "core/io/draco_mesh.h"
#include "core/io/face_order.h"
#include "core/mesh/clean_mesh.h"
#include "core/mesh/mesh_geometry.h"
#include "core/mesh/mesh_size.h"
#include "core/mesh/topology.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/memory_estimate.h"

namespace isomatch {
namespace {

// Area over squared diagonal of the bounding box: a sphere has 1, a rod a
// hundred times longer than thick 0.03.
constexpr double kThinArea = 0.003;
// Bodies have few handles; scans of parts that touch have some.
constexpr std::int64_t kManyHandles = 5;
// Share of faces.
constexpr double kManyFlatFaces = 0.01;

// A face's corners as a set.
std::array<VertexIndex, 3> Sorted(const Faces& faces, VertexIndex face) {
  std::array<VertexIndex, 3> corners = {faces(face, 0), faces(face, 1),
                                        faces(face, 2)};
  std::sort(corners.begin(), corners.end());
  return corners;
}

// True when both name the same three vertices in the same sense.
bool TurnAlike(const Faces& a, VertexIndex face_a, const Faces& b,
               VertexIndex face_b) {
  for (int i = 0; i < 3; ++i) {
    if (b(face_b, i) != a(face_a, 0)) continue;
    return b(face_b, (i + 1) % 3) == a(face_a, 1);
  }
  return false;
}

// The faces that cleaning kept, over clean vertices, as the file turns them.
// Counts those it dropped.
Faces AsInFile(const TriangleMesh& mesh, const CleanMesh& clean,
               MeshInspection* found) {
  Faces named = mesh.faces;
  for (VertexIndex& corner : named.reshaped()) {
    corner = clean.clean_from_original[corner];
  }
  Faces kept(clean.mesh.num_faces(), 3);
  VertexIndex next = 0;
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    const std::array<VertexIndex, 3> corners = Sorted(named, f);
    const bool is_degenerate = corners[0] == kNoVertex ||
                               corners[0] == corners[1] ||
                               corners[1] == corners[2];
    if (is_degenerate) {
      ++found->degenerate_faces;
    } else if (next < kept.rows() &&
               corners == Sorted(clean.mesh.faces, next)) {
      kept.row(next++) = named.row(f);
    } else {
      ++found->repeated_faces;
    }
  }
  return kept;
}

VertexIndex CountDisagreeing(const Faces& faces) {
  const EdgeFaces edges(faces);
  VertexIndex count = 0;
  for (VertexIndex f = 0; f < faces.rows(); ++f) {
    for (int corner = 0; corner < 3; ++corner) {
      const EdgeFaces::Side other = edges.Opposite(f, corner);
      if (other.face == kNoVertex || other.face < f) continue;
      count += faces(f, corner) == faces(other.face, other.corner);
    }
  }
  return count;
}

bool EnclosesVolume(const TriangleMesh& mesh, double area) {
  const Eigen::RowVector3d center = mesh.positions.colwise().mean();
  double volume = 0;
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    volume += SignedVolume6(mesh, f, center);
  }
  return std::abs(volume) > kFlatVolume * area * std::sqrt(area);
}

void InspectTurn(const CleanMesh& clean, const Faces& as_in_file,
                 MeshInspection* found) {
  const VertexIndex faces = clean.mesh.num_faces();
  for (VertexIndex f = 0; f < faces; ++f) {
    found->turned_faces += !TurnAlike(as_in_file, f, clean.mesh.faces, f);
  }
  found->disagreeing_edges = CountDisagreeing(as_in_file);
  if (!clean.oriented) {
    found->turn = FaceTurn::kNone;
  } else if (found->disagreeing_edges > 0) {
    found->turn = FaceTurn::kInconsistent;
  } else if (found->turned_faces == faces) {
    found->turn = FaceTurn::kInward;
  } else if (found->turned_faces > 0) {
    found->turn = FaceTurn::kMixed;
  } else if (!EnclosesVolume(clean.mesh, found->area)) {
    found->turn = FaceTurn::kFlat;
  }
}

VertexIndex CountFlatFaces(const TriangleMesh& mesh) {
  VertexIndex count = 0;
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    count += ExtentOf(mesh, f).is_flat();
  }
  return count;
}

void InspectVertices(const TriangleMesh& mesh, const CleanMesh& clean,
                     MeshInspection* found) {
  const std::vector<bool> is_on_face = VerticesOnFaces(mesh);
  VertexIndex kept = 0;
  for (std::size_t v = 0; v < is_on_face.size(); ++v) {
    found->isolated_vertices += !is_on_face[v];
    kept += clean.clean_from_original[v] != kNoVertex;
  }
  found->coincident_vertices = kept - clean.mesh.num_vertices();
}

void InspectSurface(const CleanMesh& clean, MeshInspection* found) {
  const TriangleMesh& mesh = clean.mesh;
  const EdgeFaces edges(mesh.faces);
  found->components = DescribeComponents(mesh);
  found->large_components =
      static_cast<int>(LargeComponents(mesh, ConnectedComponents(mesh)).size());
  found->boundary_edges = edges.boundary_edges();
  found->nonmanifold_edges = edges.nonmanifold_edges();
  found->nonmanifold_vertices =
      static_cast<int>(NonManifoldVertices(mesh, edges).size());
  found->flat_faces = CountFlatFaces(mesh);
  found->box_low = mesh.positions.colwise().minCoeff();
  found->box_high = mesh.positions.colwise().maxCoeff();
  found->area = SurfaceArea(mesh);
  found->mean_edge = MeanEdgeLength(mesh);
  found->cleaning = clean.warnings;
}

// Warnings about the parts of a surface.
void WarnOfComponents(const MeshInspection& found,
                      std::vector<std::string>* warnings) {
  const auto all = static_cast<int>(found.components.size());
  const int small = all - found.large_components;
  if (found.large_components > 1) {
    warnings->push_back(absl::StrCat(
        found.large_components,
        " large components: they are paired with those of the other mesh by "
        "size and shape and matched one by one; join them if they are one "
        "body"));
  }
  if (small > 0) {
    warnings->push_back(absl::StrCat(
        small,
        " small components, below a twentieth of the largest one's "
        "area, follow the surface next to them"));
  }
  int loops = 0;
  std::int64_t handles = 0;
  for (const ComponentTopology& component : found.components) {
    loops += component.boundary_loops;
    handles += component.Genus().value_or(0);
  }
  if (loops > 0) {
    warnings->push_back(absl::StrCat(
        "open surface with ", loops, loops == 1 ? " rim" : " rims",
        ": distances go around holes, so the other mesh should have the same "
        "ones"));
  }
  if (handles >= kManyHandles) {
    warnings->push_back(
        absl::StrCat(handles,
                     " handles: often parts that touch and were joined, which "
                     "makes distances too short"));
  }
}

// Where every coordinate is one, the mesh may have been rounded to them.
bool HasOnlyFloats(const TriangleMesh& mesh) {
  return (mesh.positions.cast<float>().cast<double>().array() ==
          mesh.positions.array())
      .all();
}

void WarnOfRounding(const TriangleMesh& mesh,
                    std::vector<std::string>* warnings) {
  const std::optional<SingleRounding> rounding = CoarseRounding(mesh);
  if (!rounding || !HasOnlyFloats(mesh)) return;
  warnings->push_back(absl::StrFormat(
      "the mesh lies %.3g away from the origin, and all its coordinates are of "
      "single precision, as STL and most PLY have them: they were rounded "
      "there by more than a hundredth of an edge (%.3g)",
      rounding->farthest, rounding->mean_edge));
}

// Warnings about faces and their extent.
void WarnOfGeometry(const MeshInspection& found,
                    std::vector<std::string>* warnings) {
  if (found.turn == FaceTurn::kNone) {
    warnings->push_back(
        "no consistent orientation: left and right cannot be told apart");
  }
  if (found.nonmanifold_edges > 0) {
    warnings->push_back(absl::StrCat(
        found.nonmanifold_edges,
        " edges with three or more faces: orientation cannot be followed "
        "across them"));
  }
  if (found.flat_faces > kManyFlatFaces * found.faces) {
    warnings->push_back(absl::StrCat(found.flat_faces,
                                     " faces of no area: normals and "
                                     "curvature are not to be trusted there"));
  }
  VertexIndex vertices = 0;
  for (const ComponentTopology& component : found.components) {
    vertices += component.vertices;
  }
  const int few = MatchOptions().first_stage_matches;
  if (vertices < few) {
    warnings->push_back(absl::StrCat("only ", vertices,
                                     " vertices, expected more than the ", few,
                                     " matches that a map grows from"));
  }
  const double diagonal = (found.box_high - found.box_low).norm();
  if (found.area < kThinArea * diagonal * diagonal) {
    warnings->push_back(absl::StrFormat(
        "the area (%.3g) is tiny for a bounding box of diagonal %.3g: threads, "
        "or parts far apart",
        found.area, diagonal));
  }
}

// Adds a refusal when `found` is more than `most`.
void CheckAtMost(const char* what, std::uint64_t found, std::uint64_t most,
                 MatchCost* cost) {
  if (found <= most) return;
  cost->refusals.push_back(
      absl::StrCat(what, ": ", found, ", expected at most ", most));
}

}  // namespace

const char* FaceTurnName(FaceTurn turn) {
  switch (turn) {
    case FaceTurn::kOutward:
      return "outward";
    case FaceTurn::kInward:
      return "inward";
    case FaceTurn::kMixed:
      return "mixed";
    case FaceTurn::kInconsistent:
      return "inconsistent";
    case FaceTurn::kNone:
      return "none";
    case FaceTurn::kFlat:
      return "flat";
  }
  return "";  // not reached
}

MeshInspection InspectMesh(const TriangleMesh& mesh) {
  MeshInspection found;
  found.vertices = mesh.num_vertices();
  found.faces = mesh.num_faces();
  // In the order that a server gives them: which faces of a patch that encloses
  // nothing are turned depends on its first one.
  TriangleMesh sent = AsSent(mesh);
  SortFaces(sent.num_vertices(), sent.faces);
  const CleanMesh clean = Clean(sent);
  InspectVertices(sent, clean, &found);
  InspectSurface(clean, &found);
  const Eigen::RowVector3d origin = SentOriginOf(mesh);
  found.box_low += origin;
  found.box_high += origin;
  InspectTurn(clean, AsInFile(sent, clean, &found), &found);
  WarnOfComponents(found, &found.warnings);
  WarnOfGeometry(found, &found.warnings);
  WarnOfRounding(mesh, &found.warnings);
  return found;
}

absl::StatusOr<MatchCost> EstimateCost(
    const TriangleMesh& mesh, const v1::GetServerInfoResponse& server) {
  MatchCost cost;
  ISOMATCH_ASSIGN_OR_RETURN(const EncodedMesh encoded, EncodeDraco(mesh));
  cost.encoded_bytes = static_cast<std::int64_t>(encoded.bytes.size());
  MatchOptions options;
  options.threads = static_cast<int>(server.threads_per_job());
  const MeshSize size = SizeOf(mesh);
  cost.memory_bytes = static_cast<std::int64_t>(2 * MeshBytes(size)) +
                      EstimatePreparedExtraBytes(size, size, options) +
                      EstimateMemoryBytes(size, size, 0, options);
  cost.seconds = AboutSeconds(mesh.num_vertices());
  const auto& limits = server.limits();
  CheckAtMost("vertices", static_cast<std::uint64_t>(size.vertices),
              limits.max_vertices(), &cost);
  CheckAtMost("faces", static_cast<std::uint64_t>(size.faces),
              limits.max_faces(), &cost);
  CheckAtMost("bytes of the compressed mesh", encoded.bytes.size(),
              limits.max_mesh_bytes(), &cost);
  if (server.memory_budget_bytes() > 0) {
    CheckAtMost("bytes of memory",
                static_cast<std::uint64_t>(cost.memory_bytes),
                server.memory_budget_bytes(), &cost);
  }
  return cost;
}

double AboutSeconds(VertexIndex vertices) {
  static constexpr std::array<std::pair<double, double>, 7> kMeasured = {
      {{1'000, 0.11},
       {5'000, 0.28},
       {13'000, 0.30},
       {50'000, 0.40},
       {100'000, 0.51},
       {200'000, 0.76},
       {1'000'000, 3.5}}};
  const double wanted = std::max<double>(vertices, 1);
  std::size_t upper = 1;
  while (upper + 1 < kMeasured.size() && kMeasured[upper].first < wanted) {
    ++upper;
  }
  const auto& [low_size, low_seconds] = kMeasured[upper - 1];
  const auto& [high_size, high_seconds] = kMeasured[upper];
  const double exponent =
      std::log(high_seconds / low_seconds) / std::log(high_size / low_size);
  return low_seconds * std::pow(wanted / low_size, exponent);
}

}  // namespace isomatch
