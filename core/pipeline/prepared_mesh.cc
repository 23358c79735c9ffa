#include "core/pipeline/prepared_mesh.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <numeric>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/parallel.h"
#include "core/base/sorted_buckets.h"
#include "core/base/status_macros.h"
#include "core/geodesic/farthest_point_sampling.h"
#include "core/mesh/clean_mesh.h"
#include "core/mesh/decimation.h"
#include "core/mesh/embedding.h"
#include "core/mesh/mesh_geometry.h"
#include "core/mesh/nearest_vertices.h"
#include "core/mesh/spatial_order.h"
#include "core/mesh/topology.h"
#include "core/spectral/mean_curvature.h"

namespace isomatch {
namespace {

/// A descriptor's ball holds some rings of the mesh.
constexpr double kLeastEdgesInRadius = 3;

/// Components large enough to take part, and no more of them than basis points
/// can serve: each needs some of its own.
std::vector<bool> TakingPart(const TriangleMesh& mesh,
                             const Components& components) {
  const std::vector<int> large = LargeComponents(mesh, components);
  const auto most = static_cast<std::size_t>(
      std::max(1, BasisPoints::DefaultCount(mesh.num_vertices()) / 2));
  std::vector<bool> taking_part(components.count, false);
  for (std::size_t i = 0; i < std::min(most, large.size()); ++i) {
    taking_part[large[i]] = true;
  }
  return taking_part;
}

/// Splits the vertices of a mesh into those kept and those left out.
struct Selected {
  VertexMap new_from_old;
  VertexMap old_from_new;
  VertexMap left_out;
};

/// The kept ones are renumbered in spatial order.
Selected SelectVertices(const TriangleMesh& mesh, const Components& components,
                        const std::vector<bool>& keep) {
  Selected selected;
  selected.new_from_old.resize(components.of_vertex.size(), kNoVertex);
  std::vector<VertexIndex> kept;
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    (keep[components.of_vertex[v]] ? kept : selected.left_out).push_back(v);
  }
  for (const VertexIndex i : SpatialOrder(mesh.positions(kept, Eigen::all))) {
    selected.new_from_old[kept[i]] =
        static_cast<VertexIndex>(selected.old_from_new.size());
    selected.old_from_new.push_back(kept[i]);
  }
  return selected;
}

TriangleMesh Submesh(const TriangleMesh& mesh, const Selected& selected) {
  TriangleMesh result;
  result.positions = mesh.positions(selected.old_from_new, Eigen::all);
  // By their first vertex; those left out in a bucket of their own.
  const auto kept = static_cast<VertexIndex>(selected.old_from_new.size());
  const SortedBuckets<VertexIndex> by_first(
      mesh.num_faces(), kept + 1,
      [&](std::int64_t f) {
        const VertexIndex first = selected.new_from_old[mesh.faces(f, 0)];
        return first == kNoVertex ? kept : first;
      },
      [](std::int64_t f) { return static_cast<VertexIndex>(f); });
  const absl::Span<const VertexIndex> faces =
      absl::MakeConstSpan(by_first.items())
          .first(by_first.items().size() - by_first[kept].size());
  result.faces.resize(std::ssize(faces), 3);
  for (std::size_t i = 0; i < faces.size(); ++i) {
    for (int corner = 0; corner < 3; ++corner) {
      result.faces(static_cast<Eigen::Index>(i), corner) =
          selected.new_from_old[mesh.faces(faces[i], corner)];
    }
  }
  return result;
}

/// Lets each left-out vertex be stood for by the nearest kept one in space.
absl::Status StandInForLeftOut(const Positions& positions, Selected* selected,
                               const std::stop_token& stop) {
  if (selected->left_out.empty()) return absl::OkStatus();
  ISOMATCH_ASSIGN_OR_RETURN(const VertexMap nearest,
                            NearestVertices(positions, selected->left_out,
                                            selected->old_from_new, stop));
  for (std::size_t i = 0; i < nearest.size(); ++i) {
    selected->new_from_old[selected->left_out[i]] = nearest[i];
  }
  return absl::OkStatus();
}

void Normalize(WorkingMesh* working) {
  Positions& positions = working->mesh.positions;
  const Eigen::RowVector3d center = positions.colwise().mean();
  positions.rowwise() -= center;
  working->area = SurfaceArea(working->mesh);
  positions /= std::sqrt(working->area);
}

double DescriptorRadius(const TriangleMesh& mesh, const MatchOptions& options) {
  return std::max(options.descriptor_radius,
                  kLeastEdgesInRadius * MeanEdgeLength(mesh));
}

}  // namespace

absl::StatusOr<WorkingMesh> MakeWorkingMesh(CleanMesh clean,
                                            const std::stop_token& stop) {
  const Components components = ConnectedComponents(clean.mesh);
  Selected selected = SelectVertices(clean.mesh, components,
                                     TakingPart(clean.mesh, components));
  WorkingMesh working;
  working.mesh = Submesh(clean.mesh, selected);
  ISOMATCH_RETURN_IF_ERROR(
      StandInForLeftOut(clean.mesh.positions, &selected, stop));
  for (const VertexIndex v : clean.clean_from_original) {
    working.working_from_user.push_back(
        v == kNoVertex ? kNoVertex : selected.new_from_old[v]);
  }
  for (const VertexIndex v : selected.old_from_new) {
    working.user_from_working.push_back(clean.original_from_clean[v]);
  }
  working.oriented = clean.oriented;
  working.warnings = std::move(clean.warnings);
  if (!selected.left_out.empty()) {
    working.warnings.push_back(absl::StrCat(
        selected.left_out.size(),
        " vertices of small components follow the nearest larger one"));
  }
  ISOMATCH_RETURN_IF_ERROR(CheckNotCancelled(stop));
  Normalize(&working);
  working.normals = VertexNormals(working.mesh);
  working.stars = VertexStars(working.mesh);
  return working;
}

namespace {

/// For each full vertex a vertex of the coarse working mesh near it: over
/// edges, or in space where none lead to one.
absl::StatusOr<VertexMap> NearestCoarse(const WorkingMesh& full,
                                        const CoarseMesh& decimated,
                                        const VertexMap& working_from_decimated,
                                        const std::stop_token& stop) {
  VertexMap in_full;
  VertexMap in_working;
  for (std::size_t d = 0; d < working_from_decimated.size(); ++d) {
    if (working_from_decimated[d] == kNoVertex) continue;
    in_full.push_back(decimated.fine_from_coarse[d]);
    in_working.push_back(working_from_decimated[d]);
  }
  VertexMap nearest =
      NearestByEdges(full.stars, full.mesh.num_vertices(), in_full);
  VertexMap lost;
  for (VertexIndex v = 0; v < full.mesh.num_vertices(); ++v) {
    if (nearest[v] == kNoVertex) lost.push_back(v);
  }
  if (!lost.empty()) {
    ISOMATCH_ASSIGN_OR_RETURN(
        const VertexMap in_space,
        NearestVertices(full.mesh.positions, lost, in_full, stop));
    for (std::size_t i = 0; i < lost.size(); ++i) {
      nearest[lost[i]] = in_space[i];
    }
  }
  for (VertexIndex& v : nearest) v = in_working[v];
  return nearest;
}

/// Cleaning chooses the outward side of each component by its volume, which on
/// open surfaces may differ between the levels: the full mesh decides.
void OrientAs(const WorkingMesh& full, CoarseLevel* coarse) {
  WorkingMesh& working = coarse->working;
  const Components components = ConnectedComponents(working.mesh);
  std::vector<double> agreement(components.count, 0);
  for (VertexIndex v = 0; v < working.mesh.num_vertices(); ++v) {
    agreement[components.of_vertex[v]] += working.normals.row(v).dot(
        full.normals.row(coarse->full_from_coarse[v]));
  }
  Faces& faces = working.mesh.faces;
  for (VertexIndex f = 0; f < working.mesh.num_faces(); ++f) {
    if (agreement[components.of_vertex[faces(f, 0)]] >= 0) continue;
    std::swap(faces(f, 1), faces(f, 2));
  }
  working.normals = VertexNormals(working.mesh);
}

absl::StatusOr<CoarseLevel> MakeCoarse(const WorkingMesh& full,
                                       VertexIndex vertices,
                                       const std::stop_token& stop) {
  ISOMATCH_ASSIGN_OR_RETURN(const CoarseMesh decimated,
                            Decimate(full.mesh, vertices, stop));
  CoarseLevel coarse;
  ISOMATCH_ASSIGN_OR_RETURN(coarse.working,
                            MakeWorkingMesh(Clean(decimated.mesh), stop));
  // Its "user" is the decimated mesh so far.
  ISOMATCH_ASSIGN_OR_RETURN(
      const VertexMap nearest,
      NearestCoarse(full, decimated, coarse.working.working_from_user, stop));
  for (VertexIndex& v : coarse.working.user_from_working) {
    const VertexIndex in_full = decimated.fine_from_coarse[v];
    coarse.full_from_coarse.push_back(in_full);
    v = full.user_from_working[in_full];
  }
  OrientAs(full, &coarse);
  coarse.working.working_from_user.clear();
  for (const VertexIndex v : full.working_from_user) {
    coarse.working.working_from_user.push_back(v == kNoVertex ? kNoVertex
                                                              : nearest[v]);
  }
  ISOMATCH_ASSIGN_OR_RETURN(
      coarse.embedding,
      EmbedInCoarse({full.mesh, full.stars},
                    {coarse.working.mesh.faces, coarse.working.stars,
                     coarse.full_from_coarse},
                    nearest, stop));
  coarse.working.oriented &= full.oriented;
  return coarse;
}

void ReflectMesh(WorkingMesh* working) {
  working->mesh.positions.col(0) *= -1;
  working->mesh.faces.col(1).swap(working->mesh.faces.col(2));
  working->normals.col(0) *= -1;
}

}  // namespace

bool IsDecimated(std::int64_t num_vertices, const MatchOptions& options) {
  constexpr double kWorthIt = 1.1;
  return options.solved_vertices > 0 &&
         double(num_vertices) > kWorthIt * options.solved_vertices;
}

DecimatedSize SizesOf(const PreparedMesh& prepared) {
  return {SizeOf(prepared.full.mesh), SizeOf(prepared.solved().mesh)};
}

absl::Status PrepareSurface(CleanMesh mesh, const MatchOptions& options,
                            const std::stop_token& stop,
                            PreparedMesh* prepared) {
  ISOMATCH_ASSIGN_OR_RETURN(prepared->full,
                            MakeWorkingMesh(std::move(mesh), stop));
  if (!IsDecimated(prepared->full.mesh.num_vertices(), options)) {
    return absl::OkStatus();
  }
  ISOMATCH_ASSIGN_OR_RETURN(
      prepared->coarse,
      MakeCoarse(prepared->full, options.solved_vertices, stop));
  const MeshSize left = SizeOf(prepared->solved().mesh);
  if (!IsDecimatedWell(left, options)) {
    prepared->full.warnings.push_back(absl::StrCat(
        "could be decimated to ", left.vertices, " vertices only, not ",
        options.solved_vertices, ": matching takes longer and more memory"));
  }
  if (prepared->full.oriented && !prepared->solved().oriented) {
    prepared->full.warnings.push_back(
        "lost its consistent orientation when decimated: mirrored maps are not "
        "told apart");
  }
  return absl::OkStatus();
}

DescribedSurface SurfaceOf(const PreparedMesh& prepared) {
  const WorkingMesh& solved = prepared.solved();
  return {solved.mesh, solved.normals, prepared.laplacian.mass, solved.stars};
}

absl::Status Describe(const MatchOptions& options, const std::stop_token& stop,
                      PreparedMesh* prepared) {
  const WorkingMesh& solved = prepared->solved();
  if (!solved.oriented || options.alignment_rounds == 0 ||
      options.descriptor_radius == 0) {
    return absl::OkStatus();
  }
  prepared->descriptor_radius = DescriptorRadius(solved.mesh, options);
  ISOMATCH_ASSIGN_OR_RETURN(
      prepared->descriptors,
      DescribeShape(SurfaceOf(*prepared), kDescribedVertices,
                    {prepared->descriptor_radius}, stop));
  return absl::OkStatus();
}

void Reflect(PreparedMesh* prepared) {
  ReflectMesh(&prepared->full);
  if (!prepared->coarse) return;
  ReflectMesh(&prepared->coarse->working);
  for (SurfacePoint& point : prepared->coarse->embedding) {
    std::swap(point.weights[1], point.weights[2]);
  }
}

absl::Status Rescale(double factor, const MatchOptions& options,
                     PreparedMesh* prepared) {
  prepared->full.mesh.positions *= factor;
  if (prepared->coarse) prepared->coarse->working.mesh.positions *= factor;
  const BasisPoints& basis = prepared->hash.basis;
  std::vector<float> fields = basis.fields();
  for (float& distance : fields) distance *= static_cast<float>(factor);
  prepared->hash.basis = BasisPoints::FromFields(
      basis.points(), basis.num_vertices(), std::move(fields));
  prepared->laplacian.mass *= factor * factor;
  prepared->spectral.mass *= factor * factor;
  prepared->spectral.functions /= factor;
  prepared->spectral.eigenvalues /= factor * factor;
  if (options.curvature_weight > 0) {
    const WorkingMesh& solved = prepared->solved();
    ISOMATCH_ASSIGN_OR_RETURN(
        prepared->curvature,
        SmoothedMeanCurvature(prepared->laplacian, solved.mesh.positions,
                              solved.normals, options.curvature_radius));
  }
  if (prepared->descriptor_radius > 0) {
    prepared->descriptor_radius =
        DescriptorRadius(prepared->solved().mesh, options);
  }
  prepared->descriptors = {};
  return absl::OkStatus();
}

absl::StatusOr<GeodesicHash> HashGeodesics(
    const WorkingMesh& working, int num_points,
    const std::function<void(double)>& progress, const std::stop_token& stop) {
  const DistanceFieldSolver solver(working.mesh, stop);
  const int basis_count =
      BasisPoints::DefaultCount(working.mesh.num_vertices());
  GeodesicHash hash;
  ISOMATCH_ASSIGN_OR_RETURN(
      hash.farthest_points,
      FarthestPoints(solver, std::max(num_points, basis_count), stop));
  ISOMATCH_ASSIGN_OR_RETURN(
      hash.basis,
      BasisPoints::Create(solver,
                          {hash.farthest_points.begin(),
                           hash.farthest_points.begin() + basis_count},
                          progress, stop));
  return hash;
}

Environments AllEnvironments(const BasisPoints& basis) {
  std::vector<VertexIndex> all(basis.num_vertices());
  std::iota(all.begin(), all.end(), 0);
  return EnvironmentsOf(basis, all);
}

std::vector<VertexIndex> PoolVertices(const GeodesicHash& hash, int pool_size,
                                      const std::vector<VertexIndex>& extra) {
  const VertexIndex n = hash.basis.num_vertices();
  std::vector<VertexIndex> vertices = hash.farthest_points;
  if (pool_size > 0 && vertices.size() > static_cast<std::size_t>(pool_size)) {
    vertices.resize(pool_size);
  }
  std::vector<char> is_in(n, false);
  for (const VertexIndex v : vertices) is_in[v] = true;
  const auto add = [&](VertexIndex v) {
    if (!is_in[v]) vertices.push_back(v);
    is_in[v] = true;
  };
  for (const VertexIndex v : extra) add(v);
  if (pool_size == 0) {
    for (VertexIndex v = 0; v < n; ++v) add(v);
  }
  return vertices;
}

}  // namespace isomatch
