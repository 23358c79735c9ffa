#include "core/geodesic/field_sweeps.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "core/geodesic/distance_field_solver.h"
#include "core/geodesic/farthest_point_sampling.h"
#include "tests/support/dirty_meshes.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

/// n x sources, by groups.
std::vector<float> SweptFields(const DistanceFieldSolver& solver,
                               const std::vector<VertexIndex>& sources,
                               float least_change = FieldSweeps::kRounding) {
  const FieldSweeps sweeps(solver.stencils(), least_change);
  // Whatever is not written stays no number.
  std::vector<float> fields(solver.num_vertices() * sources.size(),
                            std::numeric_limits<float>::quiet_NaN());
  FieldSweeps::Workspace workspace;
  for (const std::vector<int>& group : sweeps.Groups(sources)) {
    sweeps.Solve(sources, group, {}, &workspace);
    for (VertexIndex v = 0; v < solver.num_vertices(); ++v) {
      for (std::size_t lane = 0; lane < group.size(); ++lane) {
        fields[v * sources.size() + group[lane]] =
            sweeps.Distance(workspace, v, lane);
      }
    }
  }
  return fields;
}

/// Of the swept fields from those of one source at a time, in the largest
/// distance.
double GreatestDifference(const TriangleMesh& mesh,
                          const std::vector<VertexIndex>& sources) {
  const DistanceFieldSolver solver(mesh);
  const std::vector<float> swept = SweptFields(solver, sources);
  DistanceFieldSolver::Workspace workspace;
  std::vector<float> field(mesh.num_vertices());
  double difference = 0;
  float largest = 0;
  for (std::size_t z = 0; z < sources.size(); ++z) {
    solver.Solve(sources[z], field.data(), 1, &workspace);
    for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
      const float found = swept[v * sources.size() + z];
      EXPECT_EQ(found == kUnreachable, field[v] == kUnreachable);
      if (field[v] == kUnreachable) continue;
      // Not std::max, which loses NaN.
      const double off = std::abs(found - field[v]);
      if (!(off <= difference)) difference = off;
      largest = std::max(largest, field[v]);
    }
  }
  return difference / largest;
}

std::vector<VertexIndex> FarthestOf(const TriangleMesh& mesh, int count) {
  return *FarthestPoints(DistanceFieldSolver(mesh), count, {});
}

/// Two spheres that do not touch.
TriangleMesh TwoSpheres() {
  const TriangleMesh one = UnitSphere(3);
  return Joined(Untouched(one), Untouched(Shifted(one, 3)), one.num_vertices())
      .mesh;
}

TEST(FieldSweepsTest, AreTheFieldsOfOneSourceAtATime) {
  EXPECT_LT(GreatestDifference(FiveArms(4), FarthestOf(FiveArms(4), 51)), 1e-5);
  EXPECT_LT(GreatestDifference(UnitSphere(4), FarthestOf(UnitSphere(4), 30)),
            1e-5);
  EXPECT_LT(GreatestDifference(Torus(60, 25), FarthestOf(Torus(60, 25), 9)),
            1e-5);
}

/// Largest |d - |p - source|| over a plane patch, where geodesics are straight.
double PlaneError(const TriangleMesh& plane,
                  const std::vector<VertexIndex>& sources) {
  const std::vector<float> fields =
      SweptFields(DistanceFieldSolver(plane), sources);
  double worst = 0;
  for (std::size_t z = 0; z < sources.size(); ++z) {
    for (VertexIndex v = 0; v < plane.num_vertices(); ++v) {
      const double straight =
          (plane.positions.row(v) - plane.positions.row(sources[z])).norm();
      const double error = std::abs(fields[v * sources.size() + z] - straight);
      if (!(error <= worst)) worst = error;  // NaN too
    }
  }
  return worst;
}

TEST(FieldSweepsTest, AreExactInThePlane) {
  EXPECT_LT(PlaneError(PlaneGrid(30, 20, 3, 2), {0, 333, 17, 599}), 1e-5);
}

TEST(FieldSweepsTest, AreExactAcrossObtuseTriangles) {
  // Sheared and stretched to a length of 7: every face has an obtuse angle.
  TriangleMesh plane = PlaneGrid(40, 40, 1, 1);
  plane.positions.col(0) =
      4 * plane.positions.col(0) + 3 * plane.positions.col(1);
  EXPECT_LT(PlaneError(plane, FarthestOf(plane, 20)), 2e-5);
}

TEST(FieldSweepsTest, WithoutSmallChangesTheyAreALittleTooLong) {
  const TriangleMesh mesh = FiveArms(4);
  const DistanceFieldSolver solver(mesh);
  const std::vector<VertexIndex> sources = FarthestOf(mesh, 30);
  const std::vector<float> exact = SweptFields(solver, sources);
  for (const float change : {1e-4f, 1e-3f}) {
    const std::vector<float> quick = SweptFields(solver, sources, change);
    float farthest = 0;
    float most = 0;
    for (std::size_t i = 0; i < exact.size(); ++i) {
      farthest = std::max(farthest, exact[i]);
      most = std::max(most, quick[i] - exact[i]);
      EXPECT_GE(quick[i], exact[i] * (1 - 1e-5f));
    }
    EXPECT_GT(most, 0);
    EXPECT_LT(most, 5 * change * farthest);
  }
}

TEST(FieldSweepsTest, AnyUnitOfLengthWillDo) {
  for (const double scale : {1e-9, 1e9}) {
    TriangleMesh mesh = FiveArms(3);
    mesh.positions *= scale;
    EXPECT_LT(GreatestDifference(mesh, FarthestOf(FiveArms(3), 20)), 1e-5);
  }
}

TEST(FieldSweepsTest, OtherComponentsAreUnreachable) {
  const TriangleMesh mesh = TwoSpheres();
  const VertexIndex n = mesh.num_vertices();
  // Taken in turns, so that no group is of neighbors in the list.
  const std::vector<VertexIndex> sources = {0, n - 1, 5, n - 9, 40, n / 2};
  EXPECT_LT(GreatestDifference(mesh, sources), 1e-5);
  const std::vector<float> fields =
      SweptFields(DistanceFieldSolver(mesh), sources);
  EXPECT_EQ(fields[sources.size() * 0 + 1], kUnreachable);
  EXPECT_LT(fields[sources.size() * 0 + 2], kUnreachable);
}

TEST(FieldSweepsTest, GroupsHoldEachSourceOnceAndOneComponentAtMost) {
  const TriangleMesh mesh = TwoSpheres();
  const VertexIndex half = mesh.num_vertices() / 2;
  const std::vector<VertexIndex> sources = FarthestOf(mesh, 37);
  std::vector<int> times(sources.size(), 0);
  const FieldSweeps sweeps(DistanceFieldSolver(mesh).stencils());
  for (const std::vector<int>& group : sweeps.Groups(sources)) {
    ASSERT_FALSE(group.empty());
    EXPECT_LE(group.size(), std::size_t{kLanes});
    for (const int z : group) {
      ++times[z];
      EXPECT_EQ(sources[z] < half, sources[group.front()] < half);
    }
  }
  EXPECT_EQ(times, std::vector<int>(sources.size(), 1));
}

TEST(FieldSweepsTest, AStopEndsItEarly) {
  const TriangleMesh mesh = UnitSphere(3);
  const DistanceFieldSolver solver(mesh);
  const FieldSweeps sweeps(solver.stencils());
  std::stop_source stop;
  stop.request_stop();
  FieldSweeps::Workspace workspace;
  const std::vector<VertexIndex> sources = {0};
  sweeps.Solve(sources, std::vector<int>{0}, stop.get_token(), &workspace);
  EXPECT_EQ(sweeps.Distance(workspace, 0, 0), 0);
  for (VertexIndex v = 1; v < mesh.num_vertices(); ++v) {
    EXPECT_EQ(sweeps.Distance(workspace, v, 0), kUnreachable);
  }
}

}  // namespace
}  // namespace isomatch
