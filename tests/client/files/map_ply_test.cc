#include "client/files/map_ply.h"

#include <cmath>
#include <map>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/files/mesh_file.h"
#include "client/files/ply_file.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

/// The vertices of a PLY file, by the names of their properties.
std::map<std::string, std::vector<double>> VertexColumns(
    absl::string_view bytes) {
  std::map<std::string, std::vector<double>> columns;
  const absl::StatusOr<PlyHeader> header = TakePlyHeader(bytes);
  PlyBody body(bytes, header->format);
  const PlyElement& vertex = header->elements.at(0);
  for (std::int64_t v = 0; v < vertex.count; ++v) {
    for (const PlyProperty& property : vertex.properties) {
      columns[property.name].push_back(*body.TakeNumber(property.type));
    }
  }
  return columns;
}

class MapPlyTest : public testing::Test {
 protected:
  const TriangleMesh x_ = Tetrahedron();
  const TriangleMesh y_ = UnitSphere(1);
  const Colors colors_ = PositionColors(y_.positions);
  const VertexMap map_ = {7, kNoVertex, 0, 7};
};

TEST_F(MapPlyTest, EachVertexKnowsWhereItGoes) {
  const auto columns = VertexColumns(FormatMapPly({x_, y_, map_, colors_, {}}));
  EXPECT_THAT(columns.at("y_index"), testing::ElementsAre(7, -1, 0, 7));
  EXPECT_EQ(columns.at("y_y")[0], static_cast<float>(y_.positions(7, 1)));
  EXPECT_EQ(columns.at("y_z")[2], static_cast<float>(y_.positions(0, 2)));
  EXPECT_TRUE(std::isnan(columns.at("y_x")[1]));
  EXPECT_EQ(columns.at("green")[3], ColorBytes(colors_.row(7))[1]);
  EXPECT_EQ(columns.at("red")[1], kGray[0]);
  EXPECT_EQ(columns.count("confidence"), 0u);
}

TEST_F(MapPlyTest, ConfidenceComesAlong) {
  const std::vector<float> confidence = {1, 0, 0.25, 0.5};
  const auto columns =
      VertexColumns(FormatMapPly({x_, y_, map_, colors_, confidence}));
  EXPECT_THAT(columns.at("confidence"), testing::ElementsAre(1, 0, 0.25, 0.5));
}

TEST_F(MapPlyTest, ItIsAMeshStill) {
  const TemporaryFolder folder;
  const absl::StatusOr<LoadedMesh> loaded = ReadMesh(
      folder.Write("map.ply", FormatMapPly({x_, y_, map_, colors_, {}})), "X");
  ASSERT_THAT(loaded, IsOk());
  EXPECT_EQ(loaded->mesh.faces, x_.faces);
  EXPECT_TRUE(loaded->mesh.positions.isApprox(x_.positions, 1e-6));
}

}  // namespace
}  // namespace isomatch
