#include "core/geodesic/distance_field_solver.h"

#include <algorithm>
#include <cmath>
#include <stop_token>
#include <vector>

#include <gtest/gtest.h>

#include "core/mesh/clean_mesh.h"
#include "tests/support/extreme_meshes.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

std::vector<float> FieldFrom(const TriangleMesh& mesh, VertexIndex source) {
  const DistanceFieldSolver solver(mesh);
  DistanceFieldSolver::Workspace workspace;
  std::vector<float> field(mesh.num_vertices());
  solver.Solve(source, field.data(), 1, &workspace);
  return field;
}

/// Mean of |d - arc length| / arc length over the unit sphere.
double SphereError(int levels) {
  const TriangleMesh sphere = UnitSphere(levels);
  const std::vector<float> field = FieldFrom(sphere, 0);
  double sum = 0;
  for (VertexIndex v = 1; v < sphere.num_vertices(); ++v) {
    const double arc = std::acos(std::clamp(
        sphere.positions.row(0).dot(sphere.positions.row(v)), -1.0, 1.0));
    sum += std::abs(field[v] - arc) / arc;
  }
  return sum / (sphere.num_vertices() - 1);
}

/// Largest |d - |p - source|| over a plane patch, where geodesics are straight.
double PlaneError(const TriangleMesh& plane, VertexIndex source) {
  const std::vector<float> field = FieldFrom(plane, source);
  double worst = 0;
  for (VertexIndex v = 0; v < plane.num_vertices(); ++v) {
    const double straight =
        (plane.positions.row(v) - plane.positions.row(source)).norm();
    worst = std::max(worst, std::abs(field[v] - straight));
  }
  return worst;
}

TEST(DistanceFieldTest, IsExactInThePlane) {
  EXPECT_LT(PlaneError(PlaneGrid(30, 20, 3, 2), 0), 1e-5);
  EXPECT_LT(PlaneError(PlaneGrid(30, 20, 3, 2), 333), 1e-5);
}

TEST(DistanceFieldTest, IsNearlyExactAcrossObtuseTriangles) {
  // Sheared and stretched: every face has an obtuse angle.
  TriangleMesh plane = PlaneGrid(40, 40, 1, 1);
  plane.positions.col(0) =
      4 * plane.positions.col(0) + 3 * plane.positions.col(1);
  EXPECT_LT(PlaneError(plane, 860), 0.01);
}

TEST(DistanceFieldTest, ConvergesToTheArcLengthOnTheSphere) {
  const double coarse = SphereError(3);
  const double fine = SphereError(5);
  EXPECT_LT(fine, 0.002);
  // At least first order: two halvings of the edges.
  EXPECT_LT(fine, coarse / 4);
}

TEST(DistanceFieldTest, ScalesWithTheMesh) {
  const std::vector<float> field = FieldFrom(FiveArms(3), 5);
  for (const double scale : {1e-8, 1e8}) {
    const std::vector<float> scaled = FieldFrom(Moved(FiveArms(3), scale), 5);
    for (std::size_t v = 0; v < field.size(); ++v) {
      ASSERT_NEAR(scaled[v] / scale, field[v], 1e-4 * field[v] + 1e-6);
    }
  }
}

TEST(DistanceFieldTest, ObeysTheTriangleInequalityAlongEdges) {
  const TriangleMesh mesh = FiveArms(3);
  const std::vector<float> field = FieldFrom(mesh, 17);
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    for (int corner = 0; corner < 3; ++corner) {
      const VertexIndex u = mesh.faces(f, corner);
      const VertexIndex v = mesh.faces(f, (corner + 1) % 3);
      const double edge =
          (mesh.positions.row(u) - mesh.positions.row(v)).norm();
      EXPECT_LE(std::abs(field[u] - field[v]), edge * (1 + 1e-5));
    }
  }
}

TEST(DistanceFieldTest, DoesNotReachAnotherComponent) {
  TriangleMesh two;
  two.positions.resize(8, 3);
  two.positions << Tetrahedron().positions,
      (Tetrahedron().positions.array() + 10).matrix();
  two.faces.resize(8, 3);
  two.faces << Tetrahedron().faces, (Tetrahedron().faces.array() + 4).matrix();
  const std::vector<float> field = FieldFrom(two, 1);
  for (int v = 0; v < 4; ++v) EXPECT_LT(field[v], 3);
  for (int v = 4; v < 8; ++v) EXPECT_EQ(field[v], kUnreachable);
}

TEST(DistanceFieldTest, EdgesFarLongerThanTheMeanDoNotBreakTheQueue) {
  // A finely meshed sphere whose vertex 0 is pulled out a thousand radii.
  TriangleMesh spike = UnitSphere(5);
  spike.positions.row(0) *= 1000;
  const std::vector<float> field = FieldFrom(spike, 0);
  for (VertexIndex v = 1; v < spike.num_vertices(); ++v) {
    EXPECT_GT(field[v], 990);
    EXPECT_LT(field[v], 1010);
  }
}

TEST(SolveToTest, AgreesWithTheWholeField) {
  const TriangleMesh mesh = FiveArms(3);
  const DistanceFieldSolver solver(mesh);
  DistanceFieldSolver::Workspace workspace;
  const std::vector<float> field = FieldFrom(mesh, 30);
  const std::vector<VertexIndex> targets = {31, 30, 200, 5};
  std::vector<float> distances(targets.size());
  solver.SolveTo(30, targets, absl::MakeSpan(distances), &workspace);
  for (std::size_t i = 0; i < targets.size(); ++i) {
    // Later corrections stay below a thousandth.
    EXPECT_NEAR(distances[i], field[targets[i]], 1e-3 * field[targets[i]]);
  }
}

TEST(LowerTest, GivesTheMinimumOverSources) {
  const TriangleMesh mesh = FiveArms(3);
  const DistanceFieldSolver solver(mesh);
  DistanceFieldSolver::Workspace workspace;
  std::vector<float> nearest(mesh.num_vertices(), kUnreachable);
  std::vector<float> expected(mesh.num_vertices(), kUnreachable);
  for (const VertexIndex source : {3, 99, 400}) {
    solver.Lower(source, absl::MakeSpan(nearest), &workspace);
    const std::vector<float> field = FieldFrom(mesh, source);
    for (std::size_t v = 0; v < field.size(); ++v) {
      expected[v] = std::min(expected[v], field[v]);
    }
  }
  // A pruned front misses a correction now and then at the border.
  for (std::size_t v = 0; v < nearest.size(); ++v) {
    EXPECT_NEAR(nearest[v], expected[v], 0.01 * expected[v] + 1e-6);
  }
}

TEST(DistanceFieldSolverTest, EndsWhereRoundingMakesWaysEverShorter) {
  // Slivers of an extent that single precision hardly holds: planes through
  // them disagree, and sources in them came ever nearer.
  const CleanMesh clean = Clean(RandomExtremeMesh(2 * 1916).mesh);
  const DistanceFieldSolver solver(clean.mesh);
  DistanceFieldSolver::Workspace workspace;
  std::vector<float> nearest(clean.mesh.num_vertices(), kUnreachable);
  for (VertexIndex v = 0; v < clean.mesh.num_vertices(); ++v) {
    solver.Lower(v, absl::MakeSpan(nearest), &workspace);
    EXPECT_EQ(nearest[v], 0);
  }
}

TEST(DistanceFieldSolverTest, AStopEndsIt) {
  std::stop_source stop;
  const TriangleMesh mesh = UnitSphere(4);
  const DistanceFieldSolver solver(mesh, stop.get_token());
  DistanceFieldSolver::Workspace workspace;
  std::vector<float> field(mesh.num_vertices());
  stop.request_stop();
  solver.Solve(0, field.data(), 1, &workspace);
  EXPECT_EQ(field[0], 0);
  EXPECT_EQ(*std::max_element(field.begin(), field.end()), kUnreachable);
}

}  // namespace
}  // namespace isomatch
