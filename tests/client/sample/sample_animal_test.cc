#include "client/sample/sample_animal.h"

#include <algorithm>
#include <cstdint>
#include <iostream>
#include <map>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::HasSubstr;

Sample Make(char pose, int vertices, std::uint64_t mesh_seed = 1) {
  absl::StatusOr<Sample> sample = MakeSample({pose, vertices, mesh_seed});
  EXPECT_THAT(sample, IsOk());
  return *std::move(sample);
}

// Half-edges that do not have exactly one partner in the other direction.
int UnpairedHalfEdges(const Faces& faces) {
  std::map<std::pair<VertexIndex, VertexIndex>, int> count;
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    for (int i = 0; i < 3; ++i) ++count[{faces(f, i), faces(f, (i + 1) % 3)}];
  }
  int unpaired = 0;
  for (const auto& [edge, times] : count) {
    const auto twin = count.find({edge.second, edge.first});
    unpaired += times != 1 || twin == count.end() || twin->second != 1;
  }
  return unpaired;
}

// Positive when faces look outward.
double Volume(const TriangleMesh& mesh) {
  double volume = 0;
  for (Eigen::Index f = 0; f < mesh.faces.rows(); ++f) {
    const Eigen::Vector3d a = mesh.positions.row(mesh.faces(f, 0));
    const Eigen::Vector3d b = mesh.positions.row(mesh.faces(f, 1));
    const Eigen::Vector3d c = mesh.positions.row(mesh.faces(f, 2));
    volume += a.dot(b.cross(c)) / 6;
  }
  return volume;
}

// |length / length at rest - 1| of every edge, sorted.
std::vector<double> Stretches(const Sample& sample) {
  std::vector<double> stretches;
  const Faces& faces = sample.mesh.faces;
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    for (int i = 0; i < 3; ++i) {
      const VertexIndex a = faces(f, i);
      const VertexIndex b = faces(f, (i + 1) % 3);
      const Positions& posed = sample.mesh.positions;
      stretches.push_back(
          std::abs((posed.row(a) - posed.row(b)).norm() /
                       (sample.rest.row(a) - sample.rest.row(b)).norm() -
                   1));
    }
  }
  std::sort(stretches.begin(), stretches.end());
  return stretches;
}

TEST(SampleAnimalTest, IsAClosedOutwardSphereOfTheWantedSize) {
  for (const char pose : {'A', 'B', 'C'}) {
    for (const int vertices : {100, 1000, 7001}) {
      const Sample sample = Make(pose, vertices);
      EXPECT_EQ(sample.mesh.num_vertices(), vertices);
      // Euler: genus 0.
      EXPECT_EQ(sample.mesh.num_faces(), 2 * vertices - 4);
      EXPECT_EQ(UnpairedHalfEdges(sample.mesh.faces), 0);
      EXPECT_GT(Volume(sample.mesh), 0.05);
    }
  }
}

TEST(SampleAnimalTest, PosesAreNearlyIsometric) {
  for (const char pose : {'B', 'C'}) {
    const std::vector<double> stretches = Stretches(Make(pose, 5000));
    const double median = stretches[stretches.size() / 2];
    const double most = stretches[stretches.size() * 95 / 100];
    std::cout << "pose " << pose << ": |stretch - 1| median " << median
              << ", 95 % below " << most << "\n";
    EXPECT_LT(median, 0.03);
    EXPECT_LT(most, 0.15);
  }
}

TEST(SampleAnimalTest, SameOptionsGiveTheSameMeshAndOthersAnother) {
  const Sample sample = Make('B', 2000);
  EXPECT_EQ(sample.mesh.positions, Make('B', 2000).mesh.positions);
  EXPECT_EQ(sample.mesh.faces, Make('B', 2000).mesh.faces);
  EXPECT_NE(sample.rest, Make('B', 2000, /*mesh_seed=*/2).rest);
  EXPECT_NE(sample.rest, Make('A', 2000).rest);
}

TEST(SampleAnimalTest, TruthIsTheNearestAtRest) {
  const Sample x = Make('A', 1500);
  const Sample y = Make('B', 1100);
  const VertexMap truth = SampleTruth(x, y);
  for (VertexIndex v = 0; v < x.mesh.num_vertices(); ++v) {
    Eigen::Index nearest = 0;
    (y.rest.rowwise() - x.rest.row(v))
        .rowwise()
        .squaredNorm()
        .minCoeff(&nearest);
    ASSERT_EQ(truth[static_cast<std::size_t>(v)], nearest) << v;
  }
}

TEST(SampleAnimalTest, TruthOfAMeshToItselfIsTheIdentity) {
  const Sample sample = Make('A', 3000);
  const VertexMap truth = SampleTruth(sample, sample);
  for (VertexIndex v = 0; v < 3000; ++v) {
    ASSERT_EQ(truth[static_cast<std::size_t>(v)], v);
  }
}

TEST(SampleAnimalTest, WrongOptionsAreNamed) {
  EXPECT_THAT(MakeSample({'D', 1000, 1}),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("pose is 'D', expected A, B or C")));
  EXPECT_THAT(MakeSample({'A', 99, 1}),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("vertices is 99")));
}

}  // namespace
}  // namespace isomatch
