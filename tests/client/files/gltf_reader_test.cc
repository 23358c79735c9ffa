#include "client/files/gltf_reader.h"

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "client/files/mesh_file.h"
#include "tests/client/files/mesh_reading.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using Json = nlohmann::ordered_json;

constexpr int kGltfFloat = 5126;
constexpr int kGltfByte = 5121;
constexpr int kGltfShort = 5123;

template <typename T>
std::string GltfBytes(std::initializer_list<T> numbers) {
  std::string bytes(numbers.size() * sizeof(T), '\0');
  std::memcpy(bytes.data(), numbers.begin(), bytes.size());
  return bytes;
}

// Builds a glTF file of accessors that lie one after another in one buffer.
class Scene {
 public:
  int Add(const std::string& bytes, int component, int count,
          const char* type) {
    data_.resize((data_.size() + 3) / 4 * 4);
    json["bufferViews"].push_back({{"buffer", 0},
                                   {"byteOffset", data_.size()},
                                   {"byteLength", bytes.size()}});
    data_ += bytes;
    json["accessors"].push_back(
        {{"bufferView", static_cast<int>(json["bufferViews"].size()) - 1},
         {"componentType", component},
         {"count", count},
         {"type", type}});
    return static_cast<int>(json["accessors"].size()) - 1;
  }

  std::string Binary() {
    data_.resize((data_.size() + 3) / 4 * 4);
    json["buffers"] = Json::array({{{"byteLength", data_.size()}}});
    std::string text = json.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    return absl::StrCat(
        "glTF",
        GltfBytes({std::uint32_t{2},
                   static_cast<std::uint32_t>(28 + text.size() + data_.size()),
                   static_cast<std::uint32_t>(text.size())}),
        "JSON", text, GltfBytes({static_cast<std::uint32_t>(data_.size())}),
        std::string("BIN\0", 4), data_);
  }

  std::string Text(const std::string& uri) {
    json["buffers"] =
        Json::array({{{"byteLength", data_.size()}, {"uri", uri}}});
    return json.dump();
  }

  const std::string& data() const { return data_; }

  Json json = {{"asset", {{"version", "2.0"}}}, {"bufferViews", Json::array()},
               {"accessors", Json::array()},    {"scene", 0},
               {"scenes", {{{"nodes", {0}}}}},  {"nodes", {{{"mesh", 0}}}}};

 private:
  std::string data_;
};

// A square of two triangles: accessors 0 (positions) and 1 (indices).
Scene Square() {
  Scene scene;
  scene.Add(GltfBytes<float>({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}), kGltfFloat,
            4, "VEC3");
  scene.Add(GltfBytes<std::uint8_t>({0, 1, 2, 0, 2, 3}), kGltfByte, 6,
            "SCALAR");
  scene.json["meshes"] =
      Json::array({{{"primitives",
                     {{{"attributes", {{"POSITION", 0}}}, {"indices", 1}}}}}});
  return scene;
}

Json& FirstPrimitive(Scene& scene) {
  return scene.json["meshes"][0]["primitives"][0];
}

class GltfReaderTest : public MeshReadingTest {
 protected:
  LoadedMesh Good(Scene scene) {
    auto loaded = Read("a.glb", scene.Binary());
    EXPECT_THAT(loaded, IsOk());
    return *std::move(loaded);
  }
  void ExpectRefused(const std::string& name, const std::string& bytes,
                     const std::string& why) {
    EXPECT_THAT(Read(name, bytes), Refused(why));
  }
};

TEST_F(GltfReaderTest, VerticesKeepTheirOrder) {
  const LoadedMesh loaded = Good(Square());
  EXPECT_EQ(loaded.format, "glTF, binary");
  Faces faces(2, 3);
  faces << 0, 1, 2, 0, 2, 3;
  EXPECT_EQ(loaded.mesh.faces, faces);
  EXPECT_EQ(loaded.mesh.positions.row(2), Eigen::RowVector3d(1, 1, 0));
  EXPECT_THAT(loaded.warnings, IsEmpty());
  EXPECT_FALSE(loaded.colors->has_value());
  EXPECT_FALSE(loaded.texture->has_value());
}

TEST_F(GltfReaderTest, MeshesThatNoNodePlacesLieWhereTheyAre) {
  Scene scene = Square();
  for (const char* const key : {"scene", "scenes", "nodes"}) {
    scene.json.erase(key);
  }
  EXPECT_EQ(Good(scene).mesh.positions, Good(Square()).mesh.positions);
}

TEST_F(GltfReaderTest, NodesPlaceTheirMeshesInOrder) {
  Scene scene = Square();
  // The root turns x to y and moves; its children scale and mirror.
  scene.json["nodes"] = {
      {{"children", {2, 1}},
       {"translation", {10, 0, 0}},
       {"rotation", {0, 0, std::sqrt(0.5), std::sqrt(0.5)}}},
      {{"mesh", 0}, {"scale", {2, 2, 2}}},
      {{"mesh", 0},
       {"matrix", {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1}}},
      {{"mesh", 0}}};  // not in the scene
  const LoadedMesh loaded = Good(scene);
  ASSERT_EQ(loaded.mesh.num_vertices(), 8);
  const auto at = [&](int v, double x, double y, double z) {
    EXPECT_LT(
        (loaded.mesh.positions.row(v) - Eigen::RowVector3d(x, y, z)).norm(),
        1e-6)
        << v << ": " << loaded.mesh.positions.row(v);
  };
  at(1, 10, -1, 5);  // child 2 first: (-1, 0, 5), turned and moved
  at(5, 10, 2, 0);
  at(6, 8, 2, 0);
  // A mirrored place turns its faces over.
  EXPECT_EQ(loaded.mesh.faces.row(0), Eigen::RowVector3i(0, 2, 1));
  EXPECT_EQ(loaded.mesh.faces.row(2), Eigen::RowVector3i(4, 5, 6));
}

TEST_F(GltfReaderTest, PrimitivesThatShareVerticesKeepThem) {
  Scene scene = Square();
  Json& primitives = scene.json["meshes"][0]["primitives"];
  primitives[0]["indices"] =
      scene.Add(GltfBytes<std::uint16_t>({0, 1, 2}), kGltfShort, 3, "SCALAR");
  primitives.push_back(primitives[0]);
  primitives[1]["indices"] =
      scene.Add(GltfBytes<std::uint16_t>({0, 2, 3}), kGltfShort, 3, "SCALAR");
  primitives.push_back({{"attributes", {{"POSITION", 0}}}, {"mode", 0}});
  const LoadedMesh loaded = Good(scene);
  EXPECT_EQ(loaded.mesh.num_vertices(), 4);
  EXPECT_EQ(loaded.mesh.faces.row(1), Eigen::RowVector3i(0, 2, 3));
  EXPECT_THAT(loaded.warnings,
              ElementsAre(HasSubstr("1 primitives of points or lines")));
}

TEST_F(GltfReaderTest, StripsAndFansBecomeTriangles) {
  Scene scene = Square();
  FirstPrimitive(scene)["mode"] = 5;
  FirstPrimitive(scene)["indices"] = scene.Add(
      GltfBytes<std::uint8_t>({0, 1, 3, 2, 2}), kGltfByte, 5, "SCALAR");
  Faces strip(2, 3);
  strip << 0, 1, 3, 1, 2, 3;
  EXPECT_EQ(Good(scene).mesh.faces, strip);
  FirstPrimitive(scene)["mode"] = 6;
  FirstPrimitive(scene).erase("indices");
  Faces fan(2, 3);
  fan << 0, 1, 2, 0, 2, 3;
  EXPECT_EQ(Good(scene).mesh.faces, fan);
}

TEST_F(GltfReaderTest, ColorsAreLinearInTheFile) {
  Scene scene = Square();
  FirstPrimitive(scene)["attributes"]["COLOR_0"] =
      scene.Add(GltfBytes<std::uint8_t>({0, 55, 255, 255, 0, 0, 0, 255, 0, 0, 0,
                                         255, 0, 0, 0, 255}),
                kGltfByte, 4, "VEC4");
  scene.json["accessors"].back()["normalized"] = true;
  const Colors colors = **Good(scene).colors;
  EXPECT_EQ(colors(0, 0), 0);
  EXPECT_NEAR(colors(0, 1), 0.5017, 1e-3);  // of 55 / 255, by IEC 61966-2-1
  EXPECT_NEAR(colors(0, 2), 1, 1e-12);
}

TEST_F(GltfReaderTest, TextureCoordinatesComeWithTheirPicture) {
  Scene scene = Square();
  FirstPrimitive(scene)["attributes"]["TEXCOORD_1"] = scene.Add(
      GltfBytes<float>({0, 1, 1, 1, 1, 0, 0, 0.25}), kGltfFloat, 4, "VEC2");
  FirstPrimitive(scene)["material"] = 1;
  scene.json["images"] = {
      {{"uri", "data:image/png;base64," + absl::Base64Escape("\x89PNGpic")}},
      {{"uri", "a%20b.png"}}};
  scene.json["textures"] = {{{"source", 1}}, {{"source", 0}}};
  scene.json["materials"] = {
      {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}},
      {{"name", "skin\nf 1 2 3"},
       {"pbrMetallicRoughness",
        {{"baseColorTexture", {{"index", 1}, {"texCoord", 1}}}}}}};
  folder_.Write("a b.png", "\x89PNG");
  const LoadedMesh loaded = Good(scene);
  const MeshTexture& texture = **loaded.texture;
  EXPECT_EQ(texture.coordinates.row(texture.corners(0, 0)),
            Eigen::RowVector2d(0, 0));  // v from below
  EXPECT_EQ(texture.coordinates.row(texture.corners(1, 2)),
            Eigen::RowVector2d(0, 0.75));
  EXPECT_THAT(texture.materials, ElementsAre("material_0", "skin_f 1 2 3"));
  EXPECT_THAT(texture.material_of_face, ElementsAre(1, 1));
  ASSERT_THAT(texture.image_of_material, ElementsAre(0, 1));
  EXPECT_EQ(texture.images[0].path, folder_.Path("a b.png"));
  EXPECT_EQ(texture.images[1].bytes, "\x89PNGpic");
}

TEST_F(GltfReaderTest, ATextFileNamesFilesBelowItsFolderOnly) {
  Scene scene = Square();
  std::filesystem::create_directories(folder_.Path("models/parts"));
  folder_.Write("models/parts/a.bin", scene.data());
  folder_.Write("outside.bin", scene.data());
  std::filesystem::create_symlink(folder_.Path("outside.bin"),
                                  folder_.Path("models/link.bin"));
  EXPECT_THAT(Read("models/a.gltf", scene.Text("parts/a.bin")), IsOk());
  EXPECT_THAT(
      Read("models/a.gltf", scene.Text("data:application/octet-stream;base64," +
                                       absl::Base64Escape(scene.data()))),
      IsOk());
  ExpectRefused("models/a.gltf", scene.Text("../outside.bin"),
                "expected files below its own folder only");
  ExpectRefused("models/a.gltf", scene.Text("link.bin"),
                "expected files below its own folder only");
  ExpectRefused("models/a.gltf", scene.Text(folder_.Path("outside.bin")),
                "tinygltf cannot load it: File not found");
  ExpectRefused("models/a.gltf", scene.Text("none.bin"), "File not found");
  folder_.Write("models/short.bin", scene.data().substr(4));
  ExpectRefused("models/a.gltf", scene.Text("short.bin"), "size mismatch");
}

TEST_F(GltfReaderTest, WhatIsNotReadIsRefusedByName) {
  Scene packed = Square();
  packed.json["extensionsRequired"] = {"KHR_draco_mesh_compression"};
  ExpectRefused("a.glb", packed.Binary(),
                "packed by KHR_draco_mesh_compression, expected plain");
  Scene sparse = Square();
  sparse.json["accessors"][0].erase("bufferView");
  ExpectRefused("a.glb", sparse.Binary(),
                "mesh 0, primitive 0 (0-based): POSITION, accessor 0: it is "
                "sparse or has no bufferView");
  Scene old = Square();
  old.json["asset"]["version"] = "1.0";
  ExpectRefused("a.glb", old.Binary(), "asset.version is '1.0', expected 2.0");
}

TEST_F(GltfReaderTest, WrongNumbersSayWhatWasExpected) {
  Scene scene = Square();
  scene.json["accessors"][0]["count"] = 5;
  ExpectRefused("a.glb", scene.Binary(), "accessor 0: 5 elements of 12 bytes");
  scene.json["accessors"][0]["count"] = 3;
  ExpectRefused("a.glb", scene.Binary(),
                "index 5 (0-based) is 3, expected 0 to 2");
  scene = Square();
  scene.json["accessors"][0]["byteOffset"] = std::uint64_t{1} << 60;
  ExpectRefused("a.glb", scene.Binary(), "accessor 0: 4 elements");
  scene = Square();
  scene.json["bufferViews"][0]["byteLength"] = 1000;
  ExpectRefused("a.glb", scene.Binary(), "bufferView 0 has 1000 bytes");
  scene = Square();
  scene.json["accessors"][0]["type"] = "VEC2";
  ExpectRefused("a.glb", scene.Binary(),
                "its elements have 2 numbers, expected 3 to 3");
  scene = Square();
  scene.json["nodes"][0]["children"] = {0};
  ExpectRefused("a.glb", scene.Binary(),
                "node 0 (0-based): it is not there "
                "or has two parents");
  scene = Square();
  scene.json["nodes"][0]["mesh"] = 7;
  ExpectRefused("a.glb", scene.Binary(), "names mesh 7, expected 0 to 0");
  scene = Square();
  scene.json["scenes"][0]["nodes"] = Json::array();
  ExpectRefused("a.glb", scene.Binary(), "no vertices, expected a scene");
}

TEST_F(GltfReaderTest, BrokenContainersAreToldByTheByte) {
  const std::string good = Square().Binary();
  ExpectRefused("a.glb", "glTF", "byte 4: the file ends in its header");
  ExpectRefused("a.glb", good.substr(0, good.size() - 8), "byte 8: the header");
  std::string other = good;
  other[4] = 1;
  ExpectRefused("a.glb", other, "byte 4: glTF version 1, expected 2");
  other = good;
  other[12] = 1;
  ExpectRefused("a.glb", other, "byte 12: the JSON chunk has");
  ExpectRefused("a.gltf", "{\"asset\": }", "byte 11: not JSON");
}

TEST_F(GltfReaderTest, HostileFilesCostLittle) {
  // Deep, and with more objects than a scene has.
  ExpectRefused("a.gltf",
                "{\"extras\":" + std::string(100'000, '[') +
                    std::string(100'000, ']') + "}",
                "the JSON is deeper than 64, expected");
  std::string nodes = "{\"nodes\":[{}";
  for (int i = 0; i < 100'000; ++i) nodes += ",{}";
  ExpectRefused("a.gltf", nodes + "]}", "the JSON has more objects than 65536");
  // A buffer that is copied a thousand times.
  Scene scene = Square();
  std::string binary = scene.Binary();
  for (int i = 0; i < 2; ++i) {
    scene.json["buffers"].push_back(scene.json["buffers"][0]);
  }
  std::string text = scene.json.dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  ExpectRefused(
      "a.glb",
      absl::StrCat("glTF",
                   GltfBytes({std::uint32_t{2},
                              static_cast<std::uint32_t>(20 + text.size()),
                              static_cast<std::uint32_t>(text.size())}),
                   "JSON", text),
      "buffer 1 (0-based): there is no uri");
  // Triangles that are dropped are counted, too.
  Scene strips = Square();
  Json strip = FirstPrimitive(strips);
  strip["mode"] = 5;
  strip["indices"] =
      strips.Add(std::string(60'000, '\0'), kGltfByte, 60'000, "SCALAR");
  for (int i = 0; i < 1000; ++i) {
    strips.json["meshes"][0]["primitives"].push_back(strip);
  }
  ExpectRefused("a.glb", strips.Binary(), "its meshes are placed so often");
  // One mesh in many places.
  Scene many;
  many.Add(std::string(12 * 1000, '\0'), kGltfFloat, 1000, "VEC3");
  many.json["meshes"] = Json::array(
      {{{"primitives", {{{"attributes", {{"POSITION", 0}}}, {"mode", 5}}}}}});
  for (int i = 1; i < 10'000; ++i) {
    many.json["nodes"].push_back({{"mesh", 0}});
    many.json["scenes"][0]["nodes"].push_back(i);
  }
  ExpectRefused("a.glb", many.Binary(), "its meshes are placed so often");
}

TEST_F(GltfReaderTest, AnyCutOrChangedFileEndsInAStatus) {
  Scene scene = Square();
  FirstPrimitive(scene)["attributes"]["TEXCOORD_0"] = scene.Add(
      GltfBytes<float>({0, 1, 1, 1, 1, 0, 0, 0}), kGltfFloat, 4, "VEC2");
  const std::string good = scene.Binary();
  for (std::size_t size = 1; size < good.size(); ++size) {
    EXPECT_FALSE(Read("cut.glb", good.substr(0, size)).ok()) << size;
  }
  std::uint32_t random = 1;
  for (int i = 0; i < 3000; ++i) {
    std::string changed = good;
    for (int k = 0; k < 3; ++k) {
      random = random * 1664525 + 1013904223;
      changed[random % changed.size()] = static_cast<char>(random >> 24);
    }
    static_cast<void>(Read("changed.glb", changed));
  }
}

}  // namespace
}  // namespace isomatch
