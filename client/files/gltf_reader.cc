#include "client/files/gltf_reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <numeric>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "client/files/gltf_elements.h"
#include "client/files/gltf_library.h"
#include "client/files/gltf_loader.h"
#include "client/files/srgb.h"

namespace isomatch {
namespace {

namespace fs = std::filesystem;
using isomatch_tinygltf::Model;
using isomatch_tinygltf::Node;
using isomatch_tinygltf::Primitive;

// A file whose meshes are placed again and again may take this much more than
// it has, or this much.
constexpr std::size_t kMostCopies = 4;
constexpr std::size_t kFreePoints = std::size_t{1} << 22;
constexpr std::size_t kPointBytes = 12;

// Of an URI.
std::string WithoutPercents(absl::string_view uri) {
  std::string text;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    std::uint32_t code = 0;
    if (uri[i] == '%' && absl::SimpleHexAtoi(uri.substr(i + 1, 2), &code)) {
      text += static_cast<char>(code);
      i += 2;
    } else {
      text += uri[i];
    }
  }
  return text;
}

class GltfReader {
 public:
  GltfReader(std::string folder, PolygonSoup* soup)
      : folder_(std::move(folder)), soup_(soup) {}

  std::optional<MeshFault> Read(absl::string_view bytes) {
    soup_->format = absl::StartsWith(bytes, "glTF") ? "glTF, binary" : "glTF";
    if (auto fault = LoadGltf(bytes, folder_, &model_)) return fault;
    std::size_t total = bytes.size();
    for (const auto& buffer : model_.buffers) total += buffer.data.size();
    total_bytes_ = total;
    if (auto fault = PlaceScene()) return fault;
    FinishColors();
    FinishTexture();
    Warn();
    return std::nullopt;
  }

 private:
  // A place of a mesh: the transform of its node.
  struct Place {
    int node = -1;
    Eigen::Affine3d transform = Eigen::Affine3d::Identity();
  };

  std::optional<MeshFault> PlaceScene() {
    std::vector<int> roots;
    if (model_.nodes.empty()) {
      for (std::size_t m = 0; m < model_.meshes.size(); ++m) {
        if (auto fault = PlaceMesh(static_cast<int>(m), Place().transform)) {
          return fault;
        }
      }
      return std::nullopt;
    }
    if (auto fault = FindRoots(&roots)) return fault;
    std::vector<bool> is_placed(model_.nodes.size());
    std::vector<Place> waiting;
    for (auto root = roots.rbegin(); root != roots.rend(); ++root) {
      waiting.push_back({*root});
    }
    while (!waiting.empty()) {
      Place place = waiting.back();
      waiting.pop_back();
      const int n = place.node;
      if (n < 0 || n >= static_cast<int>(model_.nodes.size()) ||
          is_placed[static_cast<std::size_t>(n)]) {
        return MeshFault{absl::StrCat("node ", n, " (0-based)"),
                         absl::StrCat("it is not there or has two parents, "
                                      "expected a tree of ",
                                      model_.nodes.size(), " nodes")};
      }
      is_placed[static_cast<std::size_t>(n)] = true;
      const Node& node = model_.nodes[static_cast<std::size_t>(n)];
      place.transform = place.transform * TransformOf(node);
      if (auto fault = PlaceNode(node, place.transform)) return fault;
      for (auto c = node.children.rbegin(); c != node.children.rend(); ++c) {
        waiting.push_back({*c, place.transform});
      }
    }
    return std::nullopt;
  }

  std::optional<MeshFault> FindRoots(std::vector<int>* roots) const {
    const auto scenes = static_cast<int>(model_.scenes.size());
    const int scene = std::max(model_.defaultScene, 0);
    if (scene < scenes) {
      *roots = model_.scenes[static_cast<std::size_t>(scene)].nodes;
      return std::nullopt;
    }
    if (scenes > 0) {
      return MeshFault{"", absl::StrCat("the default scene is ", scene,
                                        ", expected 0 to ", scenes - 1)};
    }
    std::vector<bool> is_child(model_.nodes.size());
    for (const Node& node : model_.nodes) {
      for (const int child : node.children) {
        if (child >= 0 && child < static_cast<int>(is_child.size())) {
          is_child[static_cast<std::size_t>(child)] = true;
        }
      }
    }
    for (std::size_t n = 0; n < is_child.size(); ++n) {
      if (!is_child[n]) roots->push_back(static_cast<int>(n));
    }
    return std::nullopt;
  }

  static Eigen::Affine3d TransformOf(const Node& node) {
    Eigen::Affine3d transform = Eigen::Affine3d::Identity();
    if (node.matrix.size() == 16) {
      transform.matrix() =
          Eigen::Map<const Eigen::Matrix4d>(node.matrix.data());
      transform.makeAffine();
      return transform;
    }
    if (node.translation.size() == 3) {
      transform.translate(Eigen::Vector3d(node.translation.data()));
    }
    if (node.rotation.size() == 4) {  // x, y, z, w, as Eigen has them
      transform.rotate(Eigen::Quaterniond(node.rotation.data()).normalized());
    }
    if (node.scale.size() == 3) {
      transform.scale(Eigen::Vector3d(node.scale.data()));
    }
    return transform;
  }

  std::optional<MeshFault> PlaceNode(const Node& node,
                                     const Eigen::Affine3d& transform) {
    if (node.mesh < 0) return std::nullopt;
    if (node.skin < 0) return PlaceMesh(node.mesh, transform);
    has_skin_ = true;  // its joints move it, not its node
    return PlaceMesh(node.mesh, Eigen::Affine3d::Identity());
  }

  std::optional<MeshFault> PlaceMesh(int number,
                                     const Eigen::Affine3d& transform) {
    if (number >= static_cast<int>(model_.meshes.size())) {
      return MeshFault{
          "", absl::StrCat("a node names mesh ", number, ", expected 0 to ",
                           model_.meshes.size() - 1)};
    }
    std::map<std::pair<int, int>, std::size_t> first_point;
    const auto& primitives =
        model_.meshes[static_cast<std::size_t>(number)].primitives;
    for (std::size_t p = 0; p < primitives.size(); ++p) {
      if (auto fault = PlacePrimitive(primitives[p], transform, first_point)) {
        fault->where =
            absl::StrCat("mesh ", number, ", primitive ", p, " (0-based)");
        return fault;
      }
    }
    return std::nullopt;
  }

  std::optional<MeshFault> PlacePrimitive(
      const Primitive& primitive, const Eigen::Affine3d& transform,
      std::map<std::pair<int, int>, std::size_t>& first_point) {
    has_targets_ |= !primitive.targets.empty();
    const int mode =
        primitive.mode < 0 ? TINYGLTF_MODE_TRIANGLES : primitive.mode;
    if (mode < TINYGLTF_MODE_TRIANGLES || mode > TINYGLTF_MODE_TRIANGLE_FAN) {
      ++left_out_;
      return std::nullopt;
    }
    GltfElements positions;
    const int accessor = Attribute(primitive, "POSITION");
    if (auto fault =
            FindElements(model_, accessor, {"POSITION", 3, 3}, &positions)) {
      return fault;
    }
    const int color = Attribute(primitive, "COLOR_0");
    const auto [entry, is_new] =
        first_point.emplace(std::pair(accessor, color), soup_->points.size());
    if (is_new) {
      if (auto fault = AddPoints(positions, transform)) return fault;
      AddColors(color, positions.count);
    }
    std::vector<std::uint32_t> indices;
    if (auto fault = Indices(primitive, positions.count, &indices)) {
      return fault;
    }
    return AddTriangles(primitive, mode, entry->second,
                        transform.linear().determinant() < 0, indices);
  }

  static int Attribute(const Primitive& primitive, const std::string& name) {
    const auto found = primitive.attributes.find(name);
    return found == primitive.attributes.end() ? -1 : found->second;
  }

  // Whether `more` elements of `bytes` each may follow the `held` ones.
  std::optional<MeshFault> CheckRoom(std::size_t held, std::size_t more,
                                     std::size_t bytes) const {
    const std::size_t most =
        std::max(kFreePoints, kMostCopies * (total_bytes_ / bytes));
    if (more <= most && held <= most - more) return std::nullopt;
    return MeshFault{
        "", absl::StrCat("its meshes are placed so often that they have more "
                         "than ",
                         most, " vertices or corners, expected fewer for ",
                         total_bytes_, " bytes")};
  }

  std::optional<MeshFault> AddPoints(const GltfElements& positions,
                                     const Eigen::Affine3d& transform) {
    std::vector<std::array<double, 3>>& points = soup_->points;
    if (auto fault = CheckRoom(points.size(), positions.count, kPointBytes)) {
      return fault;
    }
    for (std::size_t i = 0; i < positions.count; ++i) {
      const Eigen::Vector3d point =
          transform * Eigen::Vector3d(positions.At(i, 0), positions.At(i, 1),
                                      positions.At(i, 2));
      if (!point.allFinite()) {
        return MeshFault{
            "", absl::StrCat("the position of its vertex ", i,
                             " (0-based) is not finite, expected numbers")};
      }
      points.push_back({point.x(), point.y(), point.z()});
    }
    return std::nullopt;
  }

  void AddColors(int accessor, std::size_t points) {
    if (accessor < 0 || soup_->color_fault) return;
    GltfElements colors;
    soup_->color_fault =
        FindElements(model_, accessor, {"COLOR_0", 3, 4}, &colors);
    if (soup_->color_fault) return;
    if (colors.count != points) {
      soup_->color_fault = {
          "", absl::StrCat("COLOR_0 has ", colors.count, " elements, expected ",
                           points, ", one for each vertex")};
      return;
    }
    for (std::size_t i = 0; i < points; ++i) {
      std::array<double, 3>& color = soup_->colors.emplace_back();
      for (std::size_t channel = 0; channel < 3; ++channel) {
        const double linear = colors.At(i, channel);
        color[channel] = SrgbFromLinear(linear);
        if (std::isfinite(linear) && linear >= 0) continue;
        soup_->color_fault = {"",
                              absl::StrCat("COLOR_0 of a vertex is ", linear,
                                           ", expected a number of 0 or more")};
        return;
      }
    }
  }

  std::optional<MeshFault> Indices(const Primitive& primitive,
                                   std::size_t points,
                                   std::vector<std::uint32_t>* indices) {
    GltfElements found;
    found.count = points;
    if (primitive.indices >= 0) {
      if (auto fault = FindElements(model_, primitive.indices,
                                    {"indices", 1, 1}, &found)) {
        return fault;
      }
    }
    if (auto fault = CheckRoom(taken_indices_, found.count, 1)) return fault;
    taken_indices_ += found.count;
    if (primitive.indices < 0) {
      indices->resize(points);
      std::iota(indices->begin(), indices->end(), 0u);
      return std::nullopt;
    }
    for (std::size_t i = 0; i < found.count; ++i) {
      const double index = found.At(i, 0);
      if (index < 0 || index >= static_cast<double>(points) ||
          std::floor(index) != index) {
        return MeshFault{"", absl::StrCat("index ", i, " (0-based) is ", index,
                                          ", expected 0 to ", points - 1)};
      }
      indices->push_back(static_cast<std::uint32_t>(index));
    }
    return std::nullopt;
  }

  std::optional<MeshFault> AddTriangles(
      const Primitive& primitive, int mode, std::size_t first, bool is_mirrored,
      const std::vector<std::uint32_t>& indices) {
    const std::size_t uv = FirstCoordinates(primitive, indices);
    const std::size_t step = mode == TINYGLTF_MODE_TRIANGLES ? 3 : 1;
    if (mode == TINYGLTF_MODE_TRIANGLES && indices.size() % 3 != 0) {
      return MeshFault{"", absl::StrCat(indices.size(), " indices, expected a ",
                                        "multiple of 3 for triangles")};
    }
    if (auto fault =
            CheckRoom(soup_->corners.size(), indices.size() / step * 3, 1)) {
      return fault;
    }
    for (std::size_t i = 0; i + 2 < indices.size(); i += step) {
      std::array<std::uint32_t, 3> triangle = {indices[i], indices[i + 1],
                                               indices[i + 2]};
      if (mode == TINYGLTF_MODE_TRIANGLE_FAN) triangle[0] = indices[0];
      const bool is_odd = mode == TINYGLTF_MODE_TRIANGLE_STRIP && i % 2 == 1;
      if (is_odd != is_mirrored) std::swap(triangle[1], triangle[2]);
      // Strips are joined by triangles of no area.
      if (step == 1 &&
          (triangle[0] == triangle[1] || triangle[1] == triangle[2] ||
           triangle[2] == triangle[0])) {
        continue;
      }
      AddTriangle(triangle, first, uv, primitive.material);
    }
    return std::nullopt;
  }

  static constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();

  void AddTriangle(const std::array<std::uint32_t, 3>& triangle,
                   std::size_t first, std::size_t uv, int material) {
    SoupTexture& texture = soup_->texture;
    for (const std::uint32_t index : triangle) {
      soup_->corners.push_back(static_cast<VertexIndex>(first + index));
      if (uv == kNone) continue;
      texture.coordinates_of_corner.resize(soup_->corners.size(), -1);
      texture.coordinates_of_corner.back() = static_cast<int>(uv + index);
    }
    soup_->sizes.push_back(3);
    if (uv == kNone || material < 0 ||
        material >= static_cast<int>(model_.materials.size())) {
      return;
    }
    texture.material_of_polygon.resize(soup_->sizes.size(), -1);
    texture.material_of_polygon.back() = material;
  }

  const isomatch_tinygltf::Material* MaterialOf(int number) const {
    return number < 0 || number >= static_cast<int>(model_.materials.size())
               ? nullptr
               : &model_.materials[static_cast<std::size_t>(number)];
  }

  // The row of the first vertex's coordinates; kNone for none.
  std::size_t FirstCoordinates(const Primitive& primitive,
                               const std::vector<std::uint32_t>& indices) {
    const auto* const material = MaterialOf(primitive.material);
    const int set =
        material == nullptr
            ? 0
            : material->pbrMetallicRoughness.baseColorTexture.texCoord;
    const int accessor = Attribute(primitive, absl::StrCat("TEXCOORD_", set));
    if (accessor < 0 || soup_->texture_fault) return kNone;
    std::vector<std::array<double, 2>>& rows = soup_->texture.coordinates;
    const auto [entry, is_new] = first_row_.emplace(accessor, rows.size());
    GltfElements found;
    soup_->texture_fault =
        FindElements(model_, accessor, {"TEXCOORD", 2, 2}, &found);
    if (soup_->texture_fault) return kNone;
    const std::uint32_t last =
        indices.empty() ? 0 : *std::max_element(indices.begin(), indices.end());
    if (last >= found.count) {
      soup_->texture_fault = {
          "", absl::StrCat("TEXCOORD has ", found.count,
                           " elements, expected one for ", "each vertex")};
      return kNone;
    }
    if (!is_new) return entry->second;
    soup_->texture_fault = CheckRoom(rows.size(), found.count, kPointBytes);
    for (std::size_t i = 0; i < found.count && !soup_->texture_fault; ++i) {
      rows.push_back({found.At(i, 0), 1 - found.At(i, 1)});
      if (std::isfinite(rows.back()[0]) && std::isfinite(rows.back()[1])) {
        continue;
      }
      soup_->texture_fault = {"", "TEXCOORD is not finite, expected numbers"};
    }
    return entry->second;
  }

  void FinishColors() {
    const std::size_t colored = soup_->colors.size();
    const std::size_t points = soup_->points.size();
    if (colored == 0 || soup_->color_fault || colored == points) return;
    soup_->color_fault = {
        "", absl::StrCat(points - colored, " of ", points,
                         " vertices have no color, expected all or none")};
  }

  void FinishTexture() {
    SoupTexture& texture = soup_->texture;
    if (texture.coordinates_of_corner.empty()) return;
    for (std::size_t m = 0; m < model_.materials.size(); ++m) {
      std::string name = model_.materials[m].name;
      std::replace_if(
          name.begin(), name.end(), [](unsigned char c) { return c < ' '; },
          '_');
      if (name.empty()) name = absl::StrCat("material_", m);
      texture.materials.push_back(std::move(name));
      texture.image_of_material.push_back(ImageOf(static_cast<int>(m)));
    }
  }

  // Which of the texture's images is the material's; -1 for none.
  int ImageOf(int material) {
    const int number =
        MaterialOf(material)->pbrMetallicRoughness.baseColorTexture.index;
    if (number < 0 || number >= static_cast<int>(model_.textures.size())) {
      return -1;
    }
    const int source = model_.textures[static_cast<std::size_t>(number)].source;
    if (source < 0 || source >= static_cast<int>(model_.images.size())) {
      return -1;
    }
    const auto [entry, is_new] = image_of_source_.emplace(source, -1);
    if (!is_new) return entry->second;
    SoupImage found;
    const auto& image = model_.images[static_cast<std::size_t>(source)];
    absl::string_view bytes(reinterpret_cast<const char*>(image.image.data()),
                            image.image.size());
    if (image.bufferView >= 0 && FindView(model_, image.bufferView, &bytes))
      return -1;
    image_bytes_ += bytes.size();
    if (image_bytes_ > total_bytes_) return -1;
    found.bytes = std::string(bytes);
    if (bytes.empty() && !folder_.empty()) {
      const fs::path path = fs::path(folder_) / WithoutPercents(image.uri);
      if (!IsBelow(path.string(), folder_)) return -1;
      found.path = path.string();
    }
    if (found.bytes.empty() && found.path.empty()) return -1;
    entry->second = static_cast<int>(soup_->texture.images.size());
    soup_->texture.images.push_back(std::move(found));
    return entry->second;
  }

  void Warn() {
    std::vector<std::string>& warnings = soup_->warnings;
    if (left_out_ > 0) {
      warnings.push_back(absl::StrCat(
          left_out_, " primitives of points or lines are left out"));
    }
    if (has_skin_ || has_targets_) {
      warnings.push_back(
          "skins and morph targets are left out: the mesh is as at rest");
    }
  }

  const std::string folder_;
  PolygonSoup* const soup_;
  Model model_;
  /// Of the file and its buffers.
  std::size_t total_bytes_ = 0;
  std::size_t image_bytes_ = 0;
  /// Of all primitives, also for triangles that are dropped.
  std::size_t taken_indices_ = 0;
  /// Of the coordinates of an accessor.
  std::map<int, std::size_t> first_row_;
  std::map<int, int> image_of_source_;
  int left_out_ = 0;
  bool has_skin_ = false;
  bool has_targets_ = false;
};

}  // namespace

std::optional<MeshFault> ReadGltfSoup(absl::string_view bytes,
                                      const std::string& folder,
                                      PolygonSoup* soup) {
  return GltfReader(folder, soup).Read(bytes);
}

}  // namespace isomatch
