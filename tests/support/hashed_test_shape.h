#pragma once

#include <memory>
#include <vector>

#include "core/geodesic/basis_points.h"
#include "core/geodesic/distance_field_solver.h"
#include "core/matching/closeness.h"
#include "core/matching/orientation.h"
#include "core/matching/second_stage.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// One mesh with everything the matching works on: sqrt(n) basis points, a pool
/// of farthest points, closeness of width 0.3 sqrt(area).
class HashedTestShape {
 public:
  /// `pool_size` 0 takes all vertices.
  HashedTestShape(TriangleMesh mesh, int pool_size);

  const TriangleMesh& mesh() const { return mesh_; }
  const DistanceFieldSolver& solver() const { return solver_; }
  const BasisPoints& basis() const { return basis_; }
  const Closeness& closeness() const { return closeness_; }
  const PointPool& pool() const { return pool_; }
  const PointFrames& frames() const { return frames_; }
  HashedShape hashed() const { return {closeness_, environments_}; }

 private:
  TriangleMesh mesh_;
  DistanceFieldSolver solver_;
  std::vector<VertexIndex> farthest_;
  BasisPoints basis_;
  Closeness closeness_;
  PointPool pool_;
  PointFrames frames_;
  Environments environments_;
};

}  // namespace isomatch
