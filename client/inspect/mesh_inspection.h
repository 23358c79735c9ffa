#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "core/mesh/component_topology.h"
#include "core/mesh/triangle_mesh.h"
#include "isomatch/v1/service.pb.h"

namespace isomatch {

/// How the faces of a file are turned.
enum class FaceTurn {
  kOutward,
  kInward,
  /// Neighbors agree, but some components are turned inside out.
  kMixed,
  /// Neighbors disagree, but can be made to agree.
  kInconsistent,
  /// They cannot, as on a Moebius strip.
  kNone,
  /// The surface encloses nothing: there is no outside.
  kFlat,
};

/// "outward", "inward", ...
const char* FaceTurnName(FaceTurn turn);

/// What a mesh file holds, and what becomes of it.
struct MeshInspection {
  // The mesh as the file has it.

  VertexIndex vertices = 0;
  /// After polygons were cut into triangles.
  VertexIndex faces = 0;
  /// On no face.
  VertexIndex isolated_vertices = 0;
  /// Along seams, at the place of another vertex.
  VertexIndex coincident_vertices = 0;
  /// Faces that name a vertex twice, or two of the same place.
  VertexIndex degenerate_faces = 0;
  VertexIndex repeated_faces = 0;
  FaceTurn turn = FaceTurn::kOutward;
  /// Edges at which two faces disagree in orientation.
  VertexIndex disagreeing_edges = 0;
  /// Faces that cleaning turns round.
  VertexIndex turned_faces = 0;

  // The surface as it is matched, after cleaning.

  /// By falling area.
  std::vector<ComponentTopology> components;
  /// Those that are matched one by one (core/mesh/topology.h).
  int large_components = 0;
  int boundary_edges = 0;
  int nonmanifold_edges = 0;
  int nonmanifold_vertices = 0;
  /// Faces whose corners lie on a line.
  VertexIndex flat_faces = 0;
  Eigen::RowVector3d box_low = Eigen::RowVector3d::Zero();
  Eigen::RowVector3d box_high = Eigen::RowVector3d::Zero();
  /// Squared mesh units; mesh units.
  double area = 0;
  double mean_edge = 0;
  /// What cleaning found and mended, in words.
  std::vector<std::string> cleaning;

  /// What may harm a match, in words.
  std::vector<std::string> warnings;
};

/// Looks at a mesh that ReadMesh gave. Time O(m log m).
MeshInspection InspectMesh(const TriangleMesh& mesh);

/// What it takes to match a mesh with one like it, and whether a server would.
struct MatchCost {
  /// As sent.
  std::int64_t encoded_bytes = 0;
  /// Upper bound that a server reserves, one that keeps prepared shapes.
  std::int64_t memory_bytes = 0;
  /// About, on two cores.
  double seconds = 0;
  /// Why the server would refuse it; empty when it would not.
  std::vector<std::string> refusals;
};

/// REQUIRES: ValidateMesh(mesh). INTERNAL when Draco refuses.
absl::StatusOr<MatchCost> EstimateCost(const TriangleMesh& mesh,
                                       const v1::GetServerInfoResponse& server);

/// Seconds to match two meshes of `vertices` each, read off the measurements in
/// README.md (two cores, the sample animal): along a power law between two of
/// them, and on from the last two. Half or twice as much is to be expected.
double AboutSeconds(VertexIndex vertices);

}  // namespace isomatch
