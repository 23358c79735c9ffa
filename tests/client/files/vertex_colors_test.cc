#include "client/files/vertex_colors.h"

#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/mesh/mesh_geometry.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

TEST(ColorColumnsTest, WhatWeWriteComesBack) {
  const TemporaryFolder folder;
  const TriangleMesh mesh = Tetrahedron();
  const Colors colors = PositionColors(mesh);
  const absl::StatusOr<LoadedMesh> loaded = ReadMesh(
      folder.Write("a.ply", FormatPly(mesh, ColorColumns(colors))), "Y");
  ASSERT_THAT(loaded, IsOk());
  ASSERT_TRUE(loaded->colors.ok() && loaded->colors->has_value());
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    EXPECT_EQ(ColorBytes((*loaded->colors)->row(v)), ColorBytes(colors.row(v)));
  }
}

TEST(PositionColorsTest, AVertexOnNoFaceChangesNoOther) {
  TriangleMesh body = FiveArms(2);
  const Colors colors = PositionColors(body);
  const Eigen::Index n = body.positions.rows();
  body.positions.conservativeResize(n + 1, Eigen::NoChange);
  body.positions.row(n).setConstant(1e6);
  EXPECT_EQ(PositionColors(body).topRows(n), colors);
}

TEST(PositionColorsTest, AreThoseOfThePage) {
  const TriangleMesh body = MirrorSymmetricBody(2);
  const Colors colors = PositionColors(body);
  const std::vector<Rgb> bytes = PositionRgb(body.positions, BoxOfFaces(body));
  for (VertexIndex v = 0; v < body.num_vertices(); ++v) {
    EXPECT_EQ(ColorBytes(colors.row(v)), bytes[static_cast<std::size_t>(v)]);
  }
  EXPECT_EQ(ColorBytes(kNoColor), kGray);
}

}  // namespace
}  // namespace isomatch
