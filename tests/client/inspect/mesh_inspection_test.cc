#include "client/inspect/mesh_inspection.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "client/api/isomatch_client.h"
#include "client/cli/embedded_server.h"
#include "client/files/text_file.h"
#include "client/inspect/inspection_report.h"
#include "core/io/draco_mesh.h"
#include "core/mesh/clean_mesh.h"
#include "core/mesh/mesh_geometry.h"
#include "tests/support/dirty_meshes.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

/// With the limits of a server's defaults, and memory enough.
v1::GetServerInfoResponse ServerInfo() {
  v1::GetServerInfoResponse info;
  info.mutable_limits()->set_max_vertices(5'000'000);
  info.mutable_limits()->set_max_faces(10'000'000);
  info.mutable_limits()->set_max_mesh_bytes(256 << 20);
  info.set_memory_budget_bytes(std::uint64_t{4} << 30);
  info.set_threads_per_job(2);
  return info;
}

/// What cleaning says where a server does it: of the mesh as it is sent.
std::vector<std::string> WarningsOfAMatch(const TriangleMesh& mesh) {
  const absl::StatusOr<EncodedMesh> encoded = EncodeDraco(mesh);
  EXPECT_THAT(encoded, IsOk());
  const absl::StatusOr<TriangleMesh> received =
      DecodeDraco(encoded->bytes, encoded->vertex_order, 0);
  EXPECT_THAT(received, IsOk());
  return Clean(*received).warnings;
}

std::string TurnedFaces(const TriangleMesh& mesh) {
  return absl::StrCat(InspectMesh(mesh).turned_faces,
                      " faces turned to point outwards");
}

/// A box of size 2 x 2 x 2 without its lid: 5 squares of 8 x 8 x 2 triangles,
/// each with vertices of its own along its rim.
TriangleMesh OpenBox() {
  const TriangleMesh square = PlaneGrid(8, 8, 2, 2);
  const VertexIndex n = square.num_vertices();
  TriangleMesh box;
  box.positions.resize(5 * n, 3);
  box.faces.resize(5 * square.num_faces(), 3);
  const auto add = [&](int side, const auto& place) {
    for (VertexIndex v = 0; v < n; ++v) {
      box.positions.row(side * n + v) =
          place(square.positions(v, 0), square.positions(v, 1));
    }
    box.faces.middleRows(side * square.num_faces(), square.num_faces()) =
        square.faces.array() + side * n;
  };
  using Point = Eigen::RowVector3d;
  add(0, [](double u, double v) { return Point(v, u, 0); });  // bottom, down
  add(1, [](double u, double v) { return Point(u, 0, v); });
  add(2, [](double u, double v) { return Point(v, 2, u); });
  add(3, [](double u, double v) { return Point(0, v, u); });
  add(4, [](double u, double v) { return Point(2, u, v); });
  return box;
}

TEST(MeshInspectionTest, ASphereIsAsGoodAsItGets) {
  const TriangleMesh sphere = UnitSphere(3);
  const MeshInspection found = InspectMesh(sphere);
  EXPECT_EQ(found.vertices, 642);
  EXPECT_EQ(found.faces, 1280);
  ASSERT_EQ(found.components.size(), 1u);
  EXPECT_EQ(found.components[0].Genus(), 0);
  EXPECT_EQ(found.components[0].euler_characteristic, 2);
  EXPECT_EQ(found.boundary_edges, 0);
  EXPECT_EQ(found.turn, FaceTurn::kOutward);
  EXPECT_NEAR(found.area, 4 * std::numbers::pi, 0.1);
  EXPECT_NEAR(found.mean_edge, MeanEdgeLength(sphere), 1e-7);
  EXPECT_THAT(found.cleaning, IsEmpty());
  EXPECT_THAT(found.warnings, IsEmpty());
}

TEST(MeshInspectionTest, ATorusHasGenusOne) {
  const MeshInspection found = InspectMesh(Torus(30, 15));
  EXPECT_EQ(found.components.at(0).Genus(), 1);
  EXPECT_EQ(found.turn, FaceTurn::kOutward);
  EXPECT_THAT(found.warnings, IsEmpty());
}

TEST(MeshInspectionTest, AnOpenBoxHasOneRimOnceItsSeamsAreJoined) {
  const MeshInspection found = InspectMesh(OpenBox());
  ASSERT_EQ(found.components.size(), 1u);
  EXPECT_EQ(found.components[0].boundary_loops, 1);
  EXPECT_EQ(found.components[0].Genus(), 0);
  EXPECT_EQ(found.boundary_edges, 4 * 8);
  EXPECT_DOUBLE_EQ(found.area, 5 * 4);
  // Four edges at the bottom and four upright, of 9 vertices each, in which
  // eight corners are met: at the bottom by three sides, at the top by two.
  EXPECT_EQ(found.coincident_vertices, 8 * 7 + 4 * 2 + 4 * 1);
  EXPECT_EQ(found.turn, FaceTurn::kOutward);
  EXPECT_THAT(found.warnings,
              ElementsAre(HasSubstr("open surface with 1 rim")));
}

TEST(MeshInspectionTest, ComponentsAreToldByArea) {
  const TriangleMesh sphere = UnitSphere(2);
  const DirtyMesh large =
      Joined(Untouched(sphere), Untouched(Moved(sphere, 2)), 1000);
  const MeshInspection two = InspectMesh(large.mesh);
  ASSERT_EQ(two.components.size(), 2u);
  EXPECT_NEAR(two.components[0].area / two.components[1].area, 4, 1e-6);
  EXPECT_EQ(two.large_components, 2);
  EXPECT_THAT(two.warnings, ElementsAre(HasSubstr("2 large components")));
  const MeshInspection three = InspectMesh(
      Joined(large, Untouched(Moved(UnitSphere(1), 0.1)), 2000).mesh);
  EXPECT_EQ(three.large_components, 2);
  EXPECT_THAT(three.warnings, Contains(HasSubstr("1 small components")));
}

TEST(MeshInspectionTest, OrientationIsToldAsTheFileHasIt) {
  const DirtyMesh sphere = Untouched(UnitSphere(3));
  const FacePredicate all = [](const TriangleMesh&, VertexIndex) {
    return true;
  };
  const FacePredicate one = [](const TriangleMesh&, VertexIndex face) {
    return face == 17;
  };
  const MeshInspection inward = InspectMesh(WithFlippedFaces(sphere, all).mesh);
  EXPECT_EQ(inward.turn, FaceTurn::kInward);
  EXPECT_EQ(inward.turned_faces, 1280);
  EXPECT_EQ(inward.disagreeing_edges, 0);
  const MeshInspection torn = InspectMesh(WithFlippedFaces(sphere, one).mesh);
  EXPECT_EQ(torn.turn, FaceTurn::kInconsistent);
  EXPECT_EQ(torn.turned_faces, 1);
  EXPECT_EQ(torn.disagreeing_edges, 3);
  const MeshInspection mixed = InspectMesh(
      Joined(sphere, WithFlippedFaces(Untouched(Moved(UnitSphere(2), 1)), all),
             1000)
          .mesh);
  EXPECT_EQ(mixed.turn, FaceTurn::kMixed);
  EXPECT_EQ(mixed.turned_faces, 320);
  EXPECT_EQ(InspectMesh(PlaneGrid(20, 20, 1, 1)).turn, FaceTurn::kFlat);
}

// A sheet encloses nothing, so its first face decides how the others turn;
// which one that is, the file and the server see differently.
TEST(MeshInspectionTest, TurnedFacesAreThoseThatAMatchTurns) {
  TriangleMesh sheet = PlaneGrid(20, 20, 1, 1);
  for (VertexIndex f = 0; f < sheet.num_faces(); ++f) {
    if (f % 3 == 0) std::swap(sheet.faces(f, 1), sheet.faces(f, 2));
  }
  std::reverse(sheet.faces.data(), sheet.faces.data() + sheet.faces.size());
  for (const VertexIndex first : {0, 1, 2, 3}) {
    sheet.faces.row(0).swap(sheet.faces.row(first));
    EXPECT_THAT(WarningsOfAMatch(sheet), Contains(TurnedFaces(sheet)));
  }
}

TEST(MeshInspectionTest, DamageIsCounted) {
  const DirtyMesh sphere = Untouched(UnitSphere(3));
  const FacePredicate some = [](const TriangleMesh&, VertexIndex face) {
    return face % 128 == 5;
  };
  EXPECT_EQ(InspectMesh(WithRepeatedFaces(sphere, some).mesh).repeated_faces,
            10);
  // The first of two faces stays, and in the order in which a server sees them
  // that may be the copy, which is turned.
  const TriangleMesh repeated = WithRepeatedFaces(sphere, some).mesh;
  EXPECT_THAT(WarningsOfAMatch(repeated), Contains(TurnedFaces(repeated)));
  const MeshInspection lone = InspectMesh(WithLoneVertices(sphere, 4).mesh);
  EXPECT_EQ(lone.isolated_vertices, 4);
  // They are far away, and no part of the surface.
  EXPECT_LE(lone.box_high.maxCoeff(), 1);
  EXPECT_EQ(InspectMesh(WithFins(sphere, some).mesh).nonmanifold_edges, 10);
  // Where the middle of an edge is exact in single precision.
  const DirtyMesh plane = Untouched(PlaneGrid(16, 16, 1, 1));
  EXPECT_EQ(InspectMesh(WithFlatFaces(plane, some).mesh).flat_faces, 4);
  EXPECT_EQ(InspectMesh(WithTouchingTetrahedra(sphere, some, 0.01).mesh)
                .nonmanifold_vertices,
            10);
  const TriangleMesh corners = WithRepeatedCorners(sphere, some).mesh;
  EXPECT_EQ(InspectMesh(corners).degenerate_faces, corners.num_faces() - 1280);
  EXPECT_EQ(InspectMesh(TriangleSoup(sphere).mesh).coincident_vertices,
            3 * 1280 - 642);
}

// As georeferenced meshes and those of scanners do.
TEST(MeshInspectionTest, WhereAMeshLiesDoesNotMatter) {
  const TriangleMesh near = BumpySphere(4);
  TriangleMesh far = near;
  const Eigen::RowVector3d shift(500'000, 4'500'000, 120);
  far.positions.rowwise() += shift;
  const MeshInspection here = InspectMesh(near);
  const MeshInspection there = InspectMesh(far);
  EXPECT_THAT(there.warnings, IsEmpty());
  EXPECT_EQ(there.flat_faces, here.flat_faces);
  EXPECT_EQ(there.coincident_vertices, 0);
  EXPECT_NEAR(there.area, here.area, 1e-6 * here.area);
  EXPECT_NEAR(there.mean_edge, here.mean_edge, 1e-6 * here.mean_edge);
  EXPECT_LT((there.box_low - here.box_low - shift).norm(), 1e-5);
  EXPECT_LT((there.box_high - here.box_high - shift).norm(), 1e-5);
}

TEST(MeshInspectionTest, WhatMayHarmAMatchIsSaid) {
  EXPECT_THAT(InspectMesh(Tetrahedron()).warnings,
              Contains(HasSubstr("only 4 vertices")));
  TriangleMesh rounded = Shifted(UnitSphere(3), 1e6);
  rounded.positions = rounded.positions.cast<float>().cast<double>().eval();
  EXPECT_THAT(InspectMesh(rounded).warnings,
              Contains(HasSubstr("away from the origin")));
  TriangleMesh thread = UnitSphere(3);
  thread.positions.col(2) *= 10'000;
  EXPECT_THAT(InspectMesh(thread).warnings,
              Contains(HasSubstr("tiny for a bounding box")));
  const DirtyMesh sphere = Untouched(UnitSphere(3));
  EXPECT_THAT(InspectMesh(WithFins(sphere, AtRandom(0.01, 3)).mesh).warnings,
              Contains(HasSubstr("edges with three or more faces")));
}

/// Vertices and seconds of the README's table of times.
std::vector<std::pair<VertexIndex, double>> TimesOfTheReadme() {
  const auto text = ReadFile(ISOMATCH_README, "the README");
  EXPECT_THAT(text, IsOk());
  std::vector<std::pair<VertexIndex, double>> times;
  bool is_table = false;
  for (const absl::string_view line : absl::StrSplit(*text, '\n')) {
    is_table = absl::StartsWith(line, "| vertices a side | seconds |") ||
               (is_table && absl::StartsWith(line, "|"));
    const std::vector<std::string> cells = absl::StrSplit(line, " | ");
    VertexIndex vertices = 0;
    double seconds = 0;
    if (is_table && cells.size() > 1 &&
        absl::SimpleAtoi(absl::StrReplaceAll(cells[0], {{"|", ""}, {",", ""}}),
                         &vertices) &&
        absl::SimpleAtod(cells[1], &seconds)) {
      times.emplace_back(vertices, seconds);
    }
  }
  return times;
}

TEST(AboutSecondsTest, AgreesWithTheReadme) {
  const auto times = TimesOfTheReadme();
  EXPECT_EQ(times.size(), 7);
  for (const auto& [vertices, seconds] : times) {
    EXPECT_NEAR(AboutSeconds(vertices), seconds, 1e-9) << vertices;
  }
}

TEST(AboutSecondsTest, RisesWithTheVertices) {
  double last = 0;
  for (const VertexIndex n : {1, 100, 3'000, 30'000, 500'000, 5'000'000}) {
    EXPECT_GT(AboutSeconds(n), last);
    last = AboutSeconds(n);
  }
  // Nearly in proportion beyond the last.
  EXPECT_GT(last, 12);
  EXPECT_LT(last, 30);
}

TEST(EstimateCostTest, MemoryIsWhatTheServerReserves) {
  const TriangleMesh sphere = UnitSphere(3);
  const absl::StatusOr<MatchCost> cost = EstimateCost(sphere, ServerInfo());
  ASSERT_THAT(cost, IsOk());
  EXPECT_THAT(cost->refusals, IsEmpty());
  EXPECT_GT(cost->encoded_bytes, 1000);
  const auto server = StartEmbeddedServer(1, ServerInfo().threads_per_job());
  ASSERT_THAT(server, IsOk());
  MatchRequest request;
  request.mesh_x = request.mesh_y = sphere;
  const auto job = IsomatchClient((*server)->InProcessChannel())
                       .Submit(request, std::stop_token());
  ASSERT_THAT(job, IsOk());
  EXPECT_EQ(cost->memory_bytes,
            static_cast<std::int64_t>(job->memory_estimate_bytes()));
  v1::GetServerInfoResponse more_threads = ServerInfo();
  more_threads.set_threads_per_job(64);
  EXPECT_GT(EstimateCost(sphere, more_threads)->memory_bytes,
            cost->memory_bytes);
}

TEST(MeshInspectionTest, VerticesThatAreOneInSinglePrecisionAreOne) {
  TriangleMesh seam = OpenBox();
  const int joined = InspectMesh(seam).coincident_vertices;
  ASSERT_GT(joined, 0);
  for (VertexIndex v = 0; v < seam.num_vertices(); v += 2) {
    seam.positions.row(v) *= 1 + 1e-12;
  }
  EXPECT_EQ(InspectMesh(seam).coincident_vertices, joined);
}

TEST(EstimateCostTest, EachLimitRefuses) {
  const TriangleMesh sphere = UnitSphere(3);
  v1::GetServerInfoResponse info = ServerInfo();
  info.mutable_limits()->set_max_vertices(641);
  info.mutable_limits()->set_max_faces(1279);
  info.mutable_limits()->set_max_mesh_bytes(1000);
  info.set_memory_budget_bytes(1 << 20);
  EXPECT_THAT(EstimateCost(sphere, info)->refusals,
              ElementsAre("vertices: 642, expected at most 641",
                          "faces: 1280, expected at most 1279",
                          HasSubstr("bytes of the compressed mesh: "),
                          HasSubstr("bytes of memory: ")));
}

TEST(EstimateCostTest, AMemoryLimitThatNobodyKnowsRefusesNothing) {
  v1::GetServerInfoResponse info = ServerInfo();
  info.set_memory_budget_bytes(0);
  EXPECT_THAT(EstimateCost(UnitSphere(3), info)->refusals, IsEmpty());
}

TEST(InspectionReportTest, TextAndJsonSayTheSame) {
  const DirtyMesh dirty = WithLoneVertices(Untouched(Torus(30, 15)), 1);
  InspectionReport report;
  report.path = "torus.off";
  report.format = "OFF";
  report.mesh = InspectMesh(dirty.mesh);
  report.cost = *EstimateCost(dirty.mesh, ServerInfo());
  const std::string text = FormatInspection(report);
  EXPECT_THAT(text, HasSubstr("torus.off: OFF, 451 vertices, 900 faces"));
  EXPECT_THAT(text, HasSubstr("closed, genus 1, Euler characteristic 0"));
  EXPECT_THAT(text, HasSubstr("damage       1 vertex on no face\n"));
  EXPECT_THAT(text, HasSubstr("server       would accept it"));
  EXPECT_THAT(text, Not(HasSubstr("warning")));
  const auto json = InspectionJson(report);
  EXPECT_EQ(json["components"][0]["genus"], 1);
  EXPECT_EQ(json["isolated_vertices"], 1);
  EXPECT_EQ(json["orientation"], "outward");
  EXPECT_EQ(json["accepted"], true);
  report.cost.refusals = {"vertices: 451, expected at most 1"};
  EXPECT_THAT(FormatInspection(report), HasSubstr("would refuse it"));
  EXPECT_EQ(InspectionJson(report)["accepted"], false);
}

TEST(InspectionReportTest, ManyComponentsAreSummedUp) {
  DirtyMesh many = Untouched(Tetrahedron());
  for (int i = 1; i < 8; ++i) {
    many = Joined(many, Untouched(Moved(Tetrahedron(), 1 + i)), 100);
  }
  InspectionReport report;
  report.mesh = InspectMesh(many.mesh);
  EXPECT_THAT(FormatInspection(report), HasSubstr("and 3 more, area"));
  EXPECT_EQ(InspectionJson(report)["components"].size(), 8u);
}

}  // namespace
}  // namespace isomatch
