#include "client/files/glb_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>

#include <nlohmann/json.hpp>

#include "absl/container/flat_hash_map.h"
#include "absl/strings/match.h"
#include "client/files/srgb.h"

namespace isomatch {
namespace {

using GlbJson = nlohmann::ordered_json;

// Of glTF.
constexpr int kFloat = 5126;
constexpr int kUnsignedShort = 5123;
constexpr int kUnsignedInt = 5125;
constexpr int kVertices = 34962;
constexpr int kIndices = 34963;
constexpr int kNoLight = 0;
constexpr int kRough = 1;

template <typename T>
void Append(T value, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(&value), sizeof(value));
}

// A vertex of the file, and the row of its texture coordinates, -1 for none.
struct GlbVertex {
  VertexIndex vertex;
  int row;
};

class GlbFormatter {
 public:
  GlbFormatter(const TriangleMesh& mesh, const GlbExtras& extras)
      : mesh_(mesh), extras_(extras) {
    vertices_.reserve(static_cast<std::size_t>(mesh.num_vertices()));
    for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
      vertices_.push_back({v, -1});
    }
  }

  std::string Format() {
    AddFaces();
    const GlbJson attributes = AddAttributes();
    GlbJson primitives = GlbJson::array();
    for (const auto& [material, indices] : indices_of_material_) {
      GlbJson primitive = {{"attributes", attributes},
                           {"indices", AddIndices(indices)}};
      if (material >= 0) {
        primitive["material"] = material;
      } else if (extras_.texture != nullptr) {
        primitive["attributes"].erase("TEXCOORD_0");
      }
      primitives.push_back(std::move(primitive));
    }
    json_["meshes"] = GlbJson::array({{{"primitives", std::move(primitives)}}});
    if (extras_.texture != nullptr) AddMaterials();
    json_["accessors"] = std::move(accessors_);
    json_["bufferViews"] = std::move(views_);
    json_["buffers"] = GlbJson::array({{{"byteLength", binary_.size()}}});
    return Bytes();
  }

 private:
  // Faces without texture coordinates are those of the material -1.
  void AddFaces() {
    for (VertexIndex f = 0; f < mesh_.num_faces(); ++f) {
      const int material = MaterialOf(f);
      std::vector<std::uint32_t>& indices = indices_of_material_[material];
      for (int i = 0; i < 3; ++i) {
        const int row = material < 0 ? -1 : extras_.texture->corners(f, i);
        indices.push_back(VertexFor(mesh_.faces(f, i), row));
      }
    }
  }

  // The file's material of a face: that of the texture, or one more for faces
  // that have coordinates and none.
  int MaterialOf(VertexIndex f) const {
    const MeshTexture* const texture = extras_.texture;
    if (texture == nullptr || texture->corners.row(f).minCoeff() < 0) {
      return -1;
    }
    const int material = texture->material_of_face[static_cast<std::size_t>(f)];
    return material < 0 ? static_cast<int>(texture->materials.size())
                        : material;
  }

  std::uint32_t VertexFor(VertexIndex v, int row) {
    GlbVertex& first = vertices_[static_cast<std::size_t>(v)];
    if (row < 0 || first.row == row) return static_cast<std::uint32_t>(v);
    if (first.row < 0) {
      first.row = row;
      return static_cast<std::uint32_t>(v);
    }
    const auto [entry, is_new] = copies_.try_emplace(
        std::pair(v, row), static_cast<std::uint32_t>(vertices_.size()));
    if (is_new) vertices_.push_back({v, row});
    return entry->second;
  }

  GlbJson AddAttributes() {
    GlbJson attributes = {{"POSITION", AddPositions()}};
    if (extras_.colors != nullptr) attributes["COLOR_0"] = AddColors();
    if (extras_.texture != nullptr) {
      attributes["TEXCOORD_0"] = AddCoordinates();
    }
    return attributes;
  }

  int AddPositions() {
    const std::size_t begin = Begin();
    for (const GlbVertex& vertex : vertices_) {
      for (int axis = 0; axis < 3; ++axis) {
        Append(static_cast<float>(mesh_.positions(vertex.vertex, axis)),
               &binary_);
      }
    }
    const int accessor =
        AddAccessor(begin, kVertices, {"VEC3", kFloat, vertices_.size()});
    // glTF wants them; the doubles that floats are print the same everywhere.
    GlbJson low = GlbJson::array();
    GlbJson high = GlbJson::array();
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::VectorXf column = mesh_.positions.col(axis).cast<float>();
      low.push_back(static_cast<double>(column.minCoeff()));
      high.push_back(static_cast<double>(column.maxCoeff()));
    }
    accessors_.back()["min"] = std::move(low);
    accessors_.back()["max"] = std::move(high);
    return accessor;
  }

  int AddColors() {
    constexpr double kMost = 65535;
    const std::size_t begin = Begin();
    for (const GlbVertex& vertex : vertices_) {
      for (int channel = 0; channel < 3; ++channel) {
        const double srgb =
            std::clamp((*extras_.colors)(vertex.vertex, channel), 0.0, 1.0);
        Append(static_cast<std::uint16_t>(
                   std::lround(kMost * LinearFromSrgb(srgb))),
               &binary_);
      }
      Append(static_cast<std::uint16_t>(kMost), &binary_);
    }
    const int accessor = AddAccessor(
        begin, kVertices, {"VEC4", kUnsignedShort, vertices_.size()});
    accessors_.back()["normalized"] = true;
    return accessor;
  }

  int AddCoordinates() {
    const MeshTexture::Coordinates& rows = extras_.texture->coordinates;
    const std::size_t begin = Begin();
    for (const GlbVertex& vertex : vertices_) {
      const double u = vertex.row < 0 ? 0 : rows(vertex.row, 0);
      const double v = vertex.row < 0 ? 0 : rows(vertex.row, 1);
      Append(static_cast<float>(u), &binary_);
      Append(static_cast<float>(1 - v), &binary_);
    }
    return AddAccessor(begin, kVertices, {"VEC2", kFloat, vertices_.size()});
  }

  int AddIndices(const std::vector<std::uint32_t>& indices) {
    const std::size_t begin = Begin();
    for (const std::uint32_t index : indices) Append(index, &binary_);
    return AddAccessor(begin, kIndices,
                       {"SCALAR", kUnsignedInt, indices.size()});
  }

  void AddMaterials() {
    const std::vector<std::string>& names = extras_.texture->materials;
    GlbJson materials = GlbJson::array();
    GlbJson images = GlbJson::array();
    GlbJson textures = GlbJson::array();
    const auto add = [&](const std::string& name, const std::string& picture) {
      GlbJson surface = {{"metallicFactor", kNoLight},
                         {"roughnessFactor", kRough}};
      if (!picture.empty()) {
        surface["baseColorTexture"] = {{"index", images.size()}};
        textures.push_back({{"source", images.size()}});
        images.push_back(AddPicture(picture));
      }
      materials.push_back(
          {{"name", name}, {"pbrMetallicRoughness", std::move(surface)}});
    };
    for (std::size_t m = 0; m < names.size(); ++m) {
      add(names[m], m < extras_.pictures.size() ? extras_.pictures[m] : "");
    }
    if (indices_of_material_.count(static_cast<int>(names.size())) > 0) {
      add("default", "");
    }
    if (!materials.empty()) json_["materials"] = std::move(materials);
    if (images.empty()) return;
    json_["images"] = std::move(images);
    json_["textures"] = std::move(textures);
  }

  GlbJson AddPicture(const std::string& picture) {
    const std::size_t begin = Begin();
    binary_ += picture;
    return {{"bufferView", AddView(begin)},
            {"mimeType", absl::StartsWith(picture, "\xff\xd8") ? "image/jpeg"
                                                               : "image/png"}};
  }

  struct Kind {
    const char* type;
    int component;
    std::size_t count;
  };

  int AddAccessor(std::size_t begin, int target, const Kind& kind) {
    const int view = AddView(begin);
    views_.back()["target"] = target;
    accessors_.push_back({{"bufferView", view},
                          {"componentType", kind.component},
                          {"count", kind.count},
                          {"type", kind.type}});
    return static_cast<int>(accessors_.size()) - 1;
  }

  int AddView(std::size_t begin) {
    views_.push_back({{"buffer", 0},
                      {"byteOffset", begin},
                      {"byteLength", binary_.size() - begin}});
    return static_cast<int>(views_.size()) - 1;
  }

  // Where the next bytes begin: at a multiple of 4.
  std::size_t Begin() {
    binary_.resize((binary_.size() + 3) / 4 * 4);
    return binary_.size();
  }

  std::string Bytes() {
    std::string json = json_.dump(-1, ' ', /*ensure_ascii=*/false,
                                  GlbJson::error_handler_t::replace);
    json.resize((json.size() + 3) / 4 * 4, ' ');
    Begin();
    std::string bytes = "glTF";
    Append(std::uint32_t{2}, &bytes);
    constexpr std::size_t kHeaders = 28;
    Append(static_cast<std::uint32_t>(kHeaders + json.size() + binary_.size()),
           &bytes);
    Append(static_cast<std::uint32_t>(json.size()), &bytes);
    bytes += "JSON" + json;
    Append(static_cast<std::uint32_t>(binary_.size()), &bytes);
    bytes.append("BIN\0", 4);
    return bytes + binary_;
  }

  const TriangleMesh& mesh_;
  const GlbExtras& extras_;
  std::vector<GlbVertex> vertices_;
  absl::flat_hash_map<std::pair<VertexIndex, int>, std::uint32_t> copies_;
  std::map<int, std::vector<std::uint32_t>> indices_of_material_;
  GlbJson json_ = {
      {"asset", {{"version", "2.0"}, {"generator", "Isomatch"}}},
      {"scene", 0},
      {"scenes", GlbJson::array({{{"nodes", GlbJson::array({0})}}})},
      {"nodes", GlbJson::array({{{"mesh", 0}}})}};
  GlbJson accessors_ = GlbJson::array();
  GlbJson views_ = GlbJson::array();
  std::string binary_;
};

}  // namespace

std::string FormatGlb(const TriangleMesh& mesh, const GlbExtras& extras) {
  return GlbFormatter(mesh, extras).Format();
}

}  // namespace isomatch
