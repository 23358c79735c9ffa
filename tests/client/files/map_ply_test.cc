#include "client/files/map_ply.h"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/files/mesh_file.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

/// The vertices of a PLY file as FormatPly writes it, by the names of their
/// properties.
std::map<std::string, std::vector<double>> VertexColumns(
    const std::string& bytes) {
  std::istringstream file(bytes);
  std::size_t vertices = 0;
  // Types and names.
  std::vector<std::pair<std::string, std::string>> properties;
  for (std::string line; std::getline(file, line) && line != "end_header";) {
    std::istringstream words(line);
    std::string kind;
    std::string type;
    std::string name;
    words >> kind >> type >> name;
    if (kind == "element" && type == "vertex") vertices = std::stoul(name);
    if (kind == "property" && type != "list")
      properties.push_back({type, name});
  }
  const auto take = [&](auto value) {
    file.read(reinterpret_cast<char*>(&value), sizeof(value));
    return static_cast<double>(value);
  };
  std::map<std::string, std::vector<double>> columns;
  for (std::size_t v = 0; v < vertices; ++v) {
    for (const auto& [type, name] : properties) {
      columns[name].push_back(type == "float" ? take(float{})
                              : type == "int" ? take(std::int32_t{})
                                              : take(std::uint8_t{}));
    }
  }
  return columns;
}

class MapPlyTest : public testing::Test {
 protected:
  const TriangleMesh x_ = Tetrahedron();
  const TriangleMesh y_ = UnitSphere(1);
  const Colors colors_ = PositionColors(y_);
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
