#include "core/io/draco_mesh.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <new>
#include <random>
#include <tuple>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/matchers.h"
#include "tests/support/memory_growth.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::HasSubstr;

// As encoding leaves it, near the origin.
TriangleMesh AsEncoded(TriangleMesh mesh) {
  mesh.positions = mesh.positions.cast<float>().cast<double>().eval();
  return mesh;
}

using Triples = std::vector<std::array<VertexIndex, 3>>;

Triples InTheirOrder(const Faces& faces) {
  Triples triples;
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    triples.push_back({faces(f, 0), faces(f, 1), faces(f, 2)});
  }
  return triples;
}

// Each face from its smallest vertex on, in lexicographic order.
Triples SortedFaces(const Faces& faces) {
  Triples sorted = InTheirOrder(faces);
  for (auto& [a, b, c] : sorted) {
    while (a > b || a > c) std::tie(a, b, c) = std::tuple(b, c, a);
  }
  std::sort(sorted.begin(), sorted.end());
  return sorted;
}

// Encodes, decodes and expects every index, position and face back.
VertexOrder ExpectRoundTripAs(const DracoOptions& options,
                              const TriangleMesh& mesh) {
  const absl::StatusOr<EncodedMesh> encoded = EncodeDraco(mesh, options);
  EXPECT_THAT(encoded, IsOk());
  if (!encoded.ok()) return VertexOrder::kDecoded;
  const absl::StatusOr<TriangleMesh> decoded =
      DecodeDraco(encoded->bytes, encoded->vertex_order, mesh.num_vertices());
  EXPECT_THAT(decoded, IsOk());
  if (!decoded.ok()) return VertexOrder::kDecoded;
  EXPECT_EQ(decoded->positions, AsEncoded(mesh).positions);
  EXPECT_EQ(InTheirOrder(decoded->faces), SortedFaces(mesh.faces));
  return encoded->vertex_order;
}

// The same however it is encoded; returns the order where it is compressed.
VertexOrder ExpectRoundTrip(const TriangleMesh& mesh) {
  EXPECT_EQ(ExpectRoundTripAs({.is_local = true}, mesh), VertexOrder::kDecoded);
  return ExpectRoundTripAs({}, mesh);
}

TriangleMesh Shuffled(const TriangleMesh& mesh) {
  return Relabeled(mesh, RandomPermutation(mesh.num_vertices(), /*seed=*/3));
}

TriangleMesh WithIsolatedVertices(TriangleMesh mesh, int count) {
  const Eigen::Index n = mesh.positions.rows();
  mesh.positions.conservativeResize(n + count, Eigen::NoChange);
  mesh.positions.bottomRows(count).setConstant(7);
  return mesh;
}

// Both meshes as one, without a common vertex.
TriangleMesh Together(const TriangleMesh& a, const TriangleMesh& b) {
  TriangleMesh sum;
  sum.positions.resize(a.num_vertices() + b.num_vertices(), 3);
  sum.positions << a.positions, b.positions;
  sum.faces.resize(a.num_faces() + b.num_faces(), 3);
  sum.faces << a.faces, (b.faces.array() + a.num_vertices()).matrix();
  return sum;
}

TriangleMesh WithFace(TriangleMesh mesh, VertexIndex a, VertexIndex b,
                      VertexIndex c) {
  const Eigen::Index m = mesh.faces.rows();
  mesh.faces.conservativeResize(m + 1, Eigen::NoChange);
  mesh.faces.row(m) << a, b, c;
  return mesh;
}

TEST(DracoMeshTest, ClosedMeshKeepsItsIndices) {
  EXPECT_EQ(ExpectRoundTrip(Shuffled(BumpySphere(3))),
            VertexOrder::kIdAttribute);
}

TEST(DracoMeshTest, MeshWithBoundaryKeepsItsIndices) {
  EXPECT_EQ(ExpectRoundTrip(Shuffled(PlaneGrid(20, 30, 2, 3))),
            VertexOrder::kIdAttribute);
}

TEST(DracoMeshTest, TetrahedronKeepsItsIndices) {
  ExpectRoundTrip(Tetrahedron());
}

TEST(DracoMeshTest, SeveralComponentsKeepTheirIndices) {
  ExpectRoundTrip(Shuffled(
      Together(UnitSphere(2), Together(PlaneGrid(5, 5, 1, 1), FiveArms(2)))));
}

TEST(DracoMeshTest, VerticesAtOnePlaceStayApart) {
  ExpectRoundTrip(Shuffled(Together(UnitSphere(1), UnitSphere(1))));
}

TEST(DracoMeshTest, FlippedComponentStaysFlipped) {
  TriangleMesh flipped = UnitSphere(2);
  flipped.faces.col(1).swap(flipped.faces.col(2));
  ExpectRoundTrip(Together(flipped, UnitSphere(2)));
}

TEST(DracoMeshTest, NonManifoldEdgeKeepsItsIndices) {
  // A fin on edge 0-1 of the grid, and a second face with turned direction.
  TriangleMesh fin = WithIsolatedVertices(PlaneGrid(6, 6, 1, 1), 1);
  const VertexIndex tip = fin.num_vertices() - 1;
  fin = WithFace(WithFace(fin, 8, 9, tip), 9, 8, tip);
  EXPECT_EQ(ExpectRoundTrip(Shuffled(fin)), VertexOrder::kIdAttribute);
}

TEST(DracoMeshTest, NonManifoldVertexKeepsItsIndex) {
  // Two tetrahedra that touch in vertex 0.
  TriangleMesh pair = Together(Tetrahedron(), Tetrahedron());
  for (VertexIndex& corner : pair.faces.reshaped()) {
    if (corner == 4) corner = 0;
  }
  pair.positions.row(4) = pair.positions.row(7);
  for (VertexIndex& corner : pair.faces.reshaped()) {
    if (corner == 7) corner = 4;
  }
  pair.positions.conservativeResize(7, Eigen::NoChange);
  ExpectRoundTrip(pair);
}

TEST(DracoMeshTest, RandomFacesKeepTheirIndices) {
  std::mt19937 random(/*seed=*/17);
  for (int round = 0; round < 200; ++round) {
    const int n = 4 + static_cast<int>(random() % 12);
    TriangleMesh mesh{Positions::Random(n, 3), Faces(3 * n, 3)};
    for (Eigen::Index f = 0; f < mesh.faces.rows(); ++f) {
      const auto a = static_cast<VertexIndex>(f % n);
      const auto step = static_cast<VertexIndex>(1 + random() % (n - 2));
      const VertexIndex b = (a + step) % n;
      mesh.faces.row(f) << a, b, (b + 1) % n == a ? (b + 2) % n : (b + 1) % n;
    }
    ExpectRoundTrip(mesh);
  }
}

TEST(DracoMeshTest, IsolatedVerticesAreKept) {
  EXPECT_EQ(ExpectRoundTrip(Shuffled(WithIsolatedVertices(UnitSphere(2), 20))),
            VertexOrder::kDecoded);
}

TEST(DracoMeshTest, MoreIsolatedVerticesThanSequentialHoldsStillCount) {
  const TriangleMesh mesh = WithIsolatedVertices(Tetrahedron(), 100);
  for (const bool is_local : {false, true}) {
    const auto encoded = EncodeDraco(mesh, {.is_local = is_local});
    ASSERT_THAT(encoded, IsOk());
    const absl::StatusOr<TriangleMesh> decoded =
        DecodeDraco(encoded->bytes, encoded->vertex_order, 104);
    ASSERT_THAT(decoded, IsOk());
    EXPECT_EQ(decoded->num_vertices(), 104);
    EXPECT_EQ(decoded->positions.topRows(4),
              AsEncoded(mesh).positions.topRows(4));
    EXPECT_EQ(InTheirOrder(decoded->faces), SortedFaces(mesh.faces));
  }
}

TEST(DracoMeshTest, FaceThatRepeatsACornerIsKept) {
  EXPECT_EQ(ExpectRoundTrip(WithFace(UnitSphere(1), 3, 3, 5)),
            VertexOrder::kDecoded);
}

TEST(DracoMeshTest, QuantizedPositionsAreWithinTheirStep) {
  const TriangleMesh mesh = Shuffled(BumpySphere(3));
  DracoOptions options;
  options.position_bits = 14;
  const absl::StatusOr<EncodedMesh> encoded = EncodeDraco(mesh, options);
  ASSERT_THAT(encoded, IsOk());
  const absl::StatusOr<TriangleMesh> decoded =
      DecodeDraco(encoded->bytes, encoded->vertex_order, mesh.num_vertices());
  ASSERT_THAT(decoded, IsOk());
  const double extent = (mesh.positions.colwise().maxCoeff() -
                         mesh.positions.colwise().minCoeff())
                            .maxCoeff();
  EXPECT_LT(
      (decoded->positions - AsEncoded(mesh).positions).cwiseAbs().maxCoeff(),
      extent / (1 << 13));
}

TEST(DracoMeshTest, WhereAMeshLiesDoesNotMatter) {
  // Multiples of 2^-20, so that sums with the shift are exact; 2.6 wide.
  TriangleMesh mesh = Shuffled(BumpySphere(3));
  mesh.positions = (mesh.positions * (1 << 20)).array().round() / (1 << 20);
  const absl::StatusOr<EncodedMesh> at_origin = EncodeDraco(mesh);
  mesh.positions.rowwise() += Eigen::RowVector3d(500000, 4500000, 128);
  const absl::StatusOr<EncodedMesh> far_away = EncodeDraco(mesh);
  ASSERT_THAT(at_origin, IsOk());
  ASSERT_THAT(far_away, IsOk());
  EXPECT_TRUE(at_origin->bytes == far_away->bytes);
}

TEST(DracoMeshTest, EdgebreakerRenumbersAndSequentialDoesNot) {
  const TriangleMesh mesh = Shuffled(UnitSphere(2));
  const absl::StatusOr<EncodedMesh> edgebreaker = EncodeDraco(mesh);
  ASSERT_THAT(edgebreaker, IsOk());
  EXPECT_TRUE(RenumbersVertices(edgebreaker->bytes));
  // Isolated vertices make it sequential.
  const TriangleMesh apart = WithIsolatedVertices(mesh, 1);
  const absl::StatusOr<EncodedMesh> sequential = EncodeDraco(apart);
  ASSERT_THAT(sequential, IsOk());
  EXPECT_FALSE(RenumbersVertices(sequential->bytes));
  // What it says is so.
  const auto in_draco_order =
      DecodeDraco(edgebreaker->bytes, VertexOrder::kDecoded, 0);
  const auto in_our_order =
      DecodeDraco(sequential->bytes, VertexOrder::kDecoded, 0);
  ASSERT_THAT(in_draco_order, IsOk());
  ASSERT_THAT(in_our_order, IsOk());
  EXPECT_NE(in_draco_order->positions, AsEncoded(mesh).positions);
  EXPECT_EQ(in_our_order->positions, AsEncoded(apart).positions);
}

TEST(DracoMeshTest, WhatIsNoDracoRenumbersNothing) {
  EXPECT_FALSE(RenumbersVertices(""));
  EXPECT_FALSE(RenumbersVertices("DRACO"));
  EXPECT_FALSE(RenumbersVertices("ply\nformat ascii 1.0\n"));
}

TEST(DracoMeshTest, AnotherVertexCountIsRefused) {
  const TriangleMesh mesh = WithIsolatedVertices(UnitSphere(1), 1);
  const absl::StatusOr<EncodedMesh> encoded = EncodeDraco(mesh);
  ASSERT_THAT(encoded, IsOk());
  EXPECT_THAT(DecodeDraco(encoded->bytes, VertexOrder::kDecoded, 42),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("43 vertices, expected vertex_count 42")));
}

TEST(DracoMeshTest, IdBeyondVertexCountIsRefused) {
  const absl::StatusOr<EncodedMesh> encoded = EncodeDraco(UnitSphere(1));
  ASSERT_THAT(encoded, IsOk());
  EXPECT_THAT(DecodeDraco(encoded->bytes, VertexOrder::kIdAttribute, 41),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("vertex_id 41, expected less than 41")));
}

TEST(DracoMeshTest, MissingIdsAreRefused) {
  const absl::StatusOr<EncodedMesh> encoded =
      EncodeDraco(WithIsolatedVertices(UnitSphere(1), 1));
  ASSERT_THAT(encoded, IsOk());
  EXPECT_THAT(DecodeDraco(encoded->bytes, VertexOrder::kIdAttribute, 0),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("name=vertex_id")));
}

TEST(DracoMeshTest, TakesNoMoreMemoryThanItReserves) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers change what a process allocates";
#endif
  // Edgebreaker, also of what has to be cut into pieces, sequential, and
  // vertices that the headers do not tell of.
  const TriangleMesh closed = FiveArms(6);
  const TriangleMesh isolated = WithIsolatedVertices(closed, 10);
  const TriangleMesh any = AnyFaces(30'000);
  for (const auto& [mesh, vertex_count, is_local] :
       {std::tuple(&closed, closed.num_vertices(), false),
        std::tuple(&closed, closed.num_vertices(), true),
        std::tuple(&any, any.num_vertices(), false),
        std::tuple(&isolated, isolated.num_vertices(), false),
        std::tuple(&closed, 1'000'000, false)}) {
    const auto encoded = EncodeDraco(*mesh, {.is_local = is_local});
    ASSERT_THAT(encoded, IsOk());
    std::int64_t reserved = 0;
    DracoLimits limits;
    limits.reserve = [&](std::int64_t bytes) {
      reserved += bytes;
      return absl::OkStatus();
    };
    const MemoryGrowth growth;
    ASSERT_THAT(DecodeDraco(encoded->bytes, encoded->vertex_order, vertex_count,
                            limits),
                IsOk());
    const std::int64_t taken = growth.Bytes();
    EXPECT_LE(taken, reserved);
    EXPECT_LE(reserved, 3 * taken);
    std::printf("%d vertices: %.1f MiB reserved, %.1f taken\n", vertex_count,
                static_cast<double>(reserved) / (1 << 20),
                static_cast<double>(taken) / (1 << 20));
  }
}

TEST(DracoMeshTest, WhatCannotBeReservedIsNotDecoded) {
  const absl::StatusOr<EncodedMesh> encoded = EncodeDraco(UnitSphere(3));
  ASSERT_THAT(encoded, IsOk());
  int calls = 0;
  for (int last = 1; last <= 2; ++last) {
    calls = 0;
    DracoLimits limits;
    limits.reserve = [&](std::int64_t) {
      return ++calls < last ? absl::OkStatus()
                            : absl::ResourceExhaustedError("not now");
    };
    EXPECT_THAT(DecodeDraco(encoded->bytes, encoded->vertex_order, 0, limits),
                StatusIs(absl::StatusCode::kResourceExhausted, "not now"));
    EXPECT_EQ(calls, last);
  }
}

TEST(DracoMeshTest, WithoutMemoryTheStreamIsNotCalledDamaged) {
  const absl::StatusOr<EncodedMesh> encoded = EncodeDraco(UnitSphere(3));
  ASSERT_THAT(encoded, IsOk());
  DracoLimits limits;
  limits.reserve = [](std::int64_t) -> absl::Status { throw std::bad_alloc(); };
  EXPECT_THAT(
      DecodeDraco(encoded->bytes, encoded->vertex_order, 0, limits),
      StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("memory")));
}

TEST(DracoMeshTest, LimitsAreKept) {
  const absl::StatusOr<EncodedMesh> encoded = EncodeDraco(UnitSphere(3));
  ASSERT_THAT(encoded, IsOk());
  const auto decode = [&](const DracoLimits& limits) {
    return DecodeDraco(encoded->bytes, encoded->vertex_order, 0, limits);
  };
  DracoLimits exact;
  exact.max_vertices = 642;
  exact.max_faces = 1280;
  EXPECT_THAT(decode(exact), IsOk());
  DracoLimits few_vertices = exact;
  few_vertices.max_vertices = 641;
  EXPECT_THAT(decode(few_vertices),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("642 vertices, expected at most 641")));
  DracoLimits few_faces = exact;
  few_faces.max_faces = 1279;
  EXPECT_THAT(decode(few_faces), StatusIs(absl::StatusCode::kInvalidArgument,
                                          HasSubstr("1280 faces")));
  DracoLimits few_bytes = exact;
  few_bytes.max_attribute_bytes = 642 * 16 - 1;
  EXPECT_THAT(decode(few_bytes),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("10272 bytes of attributes")));
}

}  // namespace
}  // namespace isomatch
