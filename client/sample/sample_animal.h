#pragma once

#include <cstdint>

#include "absl/status/statusor.h"
#include "core/base/vertex_index.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// Which sample to make.
struct SampleOptions {
  static constexpr int kMinVertices = 100;
  static constexpr int kMaxVertices = 5'000'000;

  /// 'A', 'B' or 'C': one animal in near-isometric poses.
  char pose = 'A';
  /// kMinVertices to kMaxVertices; met exactly.
  int vertices = 5000;
  /// Another seed, or another pose, gives an independent triangulation.
  std::uint64_t mesh_seed = 1;

  /// INVALID_ARGUMENT naming field, value and allowed range.
  absl::Status Validate() const;
};

/// A sample mesh, and where its vertices lie on the animal at rest (n x 3),
/// which is what meshes of all poses have in common.
struct Sample {
  TriangleMesh mesh;
  Positions rest;
};

/// Returns a procedural four-legged animal: closed manifold of genus 0, outward
/// faces, about 2 units long, vertices in random order. The same options give
/// the same sample. INVALID_ARGUMENT: options. INTERNAL: see MeshSurface.
absl::StatusOr<Sample> MakeSample(const SampleOptions& options);

/// Returns the true map from X to Y: for each vertex of X the vertex of Y that
/// is nearest to it on the animal at rest.
VertexMap SampleTruth(const Sample& x, const Sample& y);

}  // namespace isomatch
