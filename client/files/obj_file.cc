#include "client/files/obj_file.h"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "client/files/obj_reader.h"
#include "client/files/text_file.h"
#include "client/files/triangulation.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

namespace fs = std::filesystem;

using Words = std::vector<absl::string_view>;

// The lines of an OBJ file that speak of textures.
struct ObjLines {
  std::vector<Eigen::RowVector2d> places;
  // Of each polygon: its vertices, its rows of `places` and its material.
  std::vector<std::vector<std::size_t>> vertices;
  std::vector<std::vector<int>> places_of;
  std::vector<int> material_of;
  std::vector<std::string> materials;
  std::vector<std::string> libraries;

  int vertices_before = 0;
  int material = -1;
  std::map<std::string, int> number_of_material;
};

// A 1-based number, or one that counts back from the last of `count`; -1 when
// there is no such one.
int Resolved(int number, int count) {
  const int resolved = number > 0 ? number - 1 : count + number;
  return number != 0 && 0 <= resolved && resolved < count ? resolved : -1;
}

// Of a face's corner, V, V/VT, V/VT/VN or V//VN.
absl::Status ReadCorner(const std::string& path, int line,
                        absl::string_view word, ObjLines& lines) {
  const Words numbers = absl::StrSplit(word, '/');
  int vertex = 0;
  int place = 0;
  // ReadMesh has read the vertices already.
  if (absl::SimpleAtoi(numbers[0], &vertex)) {
    vertex = vertex > 0 ? vertex - 1 : lines.vertices_before + vertex;
  }
  lines.vertices.back().push_back(static_cast<std::size_t>(vertex));
  if (numbers.size() < 2 || numbers[1].empty()) {
    lines.places_of.back().push_back(-1);
    return absl::OkStatus();
  }
  const int count = static_cast<int>(lines.places.size());
  if (!absl::SimpleAtoi(numbers[1], &place) || Resolved(place, count) < 0) {
    return LineError(
        path, line,
        absl::StrCat("a corner's texture coordinates are '", word.substr(0, 40),
                     "', expected V/VT with VT from 1 to ", count,
                     ", the number of lines vt so far"));
  }
  lines.places_of.back().push_back(Resolved(place, count));
  return absl::OkStatus();
}

absl::Status ReadFace(const std::string& path, int line, const Words& words,
                      ObjLines& lines) {
  lines.vertices.emplace_back();
  lines.places_of.emplace_back();
  lines.material_of.push_back(lines.material);
  for (std::size_t i = 1; i < words.size(); ++i) {
    ISOMATCH_RETURN_IF_ERROR(ReadCorner(path, line, words[i], lines));
  }
  return absl::OkStatus();
}

absl::Status ReadPlace(const std::string& path, int line, const Words& words,
                       ObjLines& lines) {
  Eigen::RowVector2d place(0, 0);  // v may be left out
  const bool has_numbers =
      words.size() >= 2 && absl::SimpleAtod(words[1], &place[0]) &&
      (words.size() == 2 || absl::SimpleAtod(words[2], &place[1]));
  if (!has_numbers || !place.allFinite()) {
    return LineError(path, line, "expected `vt u v` with finite numbers");
  }
  lines.places.push_back(place);
  return absl::OkStatus();
}

// The material of faces that have none, after faces that have one.
constexpr char kNoMaterial[] = "(none)";

// What follows the first word of a line, which may have blanks.
std::string Rest(absl::string_view row, absl::string_view first_word) {
  row.remove_prefix(static_cast<std::size_t>(first_word.data() - row.data()) +
                    first_word.size());
  return std::string(absl::StripAsciiWhitespace(row));
}

absl::Status ReadLine(const std::string& path, int line, absl::string_view row,
                      ObjLines& lines) {
  const Words words = SplitWords(row);
  if (words[0] == "v") ++lines.vertices_before;
  if (words[0] == "vt") return ReadPlace(path, line, words, lines);
  if (words[0] == "f") return ReadFace(path, line, words, lines);
  if (words[0] == "mtllib") {
    lines.libraries.push_back(
        (fs::path(path).parent_path() / Rest(row, words[0])).string());
  } else if (words[0] == "usemtl") {
    const std::string name = Rest(row, words[0]);
    if (name == kNoMaterial) {
      lines.material = -1;
      return absl::OkStatus();
    }
    const auto [entry, is_new] = lines.number_of_material.emplace(
        name, static_cast<int>(lines.materials.size()));
    if (is_new) lines.materials.push_back(name);
    lines.material = entry->second;
  }
  return absl::OkStatus();
}

absl::StatusOr<ObjLines> ReadLines(const std::string& path) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::string text, ReadFile(path, "a mesh"));
  ObjLines lines;
  ISOMATCH_RETURN_IF_ERROR(
      ForEachObjStatement(text, [&](int line, absl::string_view statement) {
        return ReadLine(path, line, statement, lines);
      }));
  return lines;
}

// True when the polygons are those that ReadMesh cut into these faces.
bool AreFacesOf(const ObjLines& lines,
                const std::vector<CutTriangle>& triangles, const Faces& faces) {
  if (faces.rows() != static_cast<Eigen::Index>(triangles.size())) return false;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t vertex =
          lines.vertices[triangles[t].polygon][triangles[t].corners[i]];
      if (static_cast<std::size_t>(faces(static_cast<Eigen::Index>(t),
                                         static_cast<Eigen::Index>(i))) !=
          vertex) {
        return false;
      }
    }
  }
  return true;
}

// Whether all polygons can be cut.
bool AreCuttable(const ObjLines& lines, VertexIndex vertices) {
  for (const std::vector<std::size_t>& polygon : lines.vertices) {
    if (polygon.size() < 3) return false;
    for (const std::size_t vertex : polygon) {
      if (vertex >= static_cast<std::size_t>(vertices)) return false;
    }
  }
  return true;
}

MeshTexture ToTexture(ObjLines lines,
                      const std::vector<CutTriangle>& triangles) {
  MeshTexture texture;
  texture.places.resize(static_cast<Eigen::Index>(lines.places.size()), 2);
  for (std::size_t i = 0; i < lines.places.size(); ++i) {
    texture.places.row(static_cast<Eigen::Index>(i)) = lines.places[i];
  }
  texture.corners.resize(static_cast<Eigen::Index>(triangles.size()), 3);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const auto& [polygon, corners] = triangles[t];
    for (std::size_t i = 0; i < 3; ++i) {
      texture.corners(static_cast<Eigen::Index>(t),
                      static_cast<Eigen::Index>(i)) =
          lines.places_of[polygon][corners[i]];
    }
    texture.material_of_face.push_back(lines.material_of[polygon]);
  }
  texture.materials = std::move(lines.materials);
  texture.libraries = std::move(lines.libraries);
  return texture;
}

void AppendVertices(const TriangleMesh& mesh, const Colors* colors,
                    std::string* text) {
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    *text += 'v';
    for (int axis = 0; axis < 3; ++axis) {
      *text += ' ';
      AppendNumber(mesh.positions(v, axis), text);
    }
    if (colors != nullptr) {
      absl::StrAppendFormat(text, " %.3f %.3f %.3f", (*colors)(v, 0),
                            (*colors)(v, 1), (*colors)(v, 2));
    }
    *text += '\n';
  }
}

void AppendCorner(VertexIndex vertex, VertexIndex place, std::string* text) {
  absl::StrAppend(text, " ", vertex + 1);
  if (place >= 0) absl::StrAppend(text, "/", place + 1);
}

// Without dots, and without links as far as it exists; `path` itself where that
// cannot be told.
fs::path Absolute(const fs::path& path) {
  std::error_code error;
  const fs::path absolute =
      fs::weakly_canonical(fs::absolute(path, error), error);
  return error ? path : absolute;
}

// Names the files from the folder of `path`.
void AppendLibraries(const std::string& path, const MeshTexture& texture,
                     std::string* text) {
  const fs::path folder = Absolute(path).parent_path();
  for (const std::string& library : texture.libraries) {
    absl::StrAppend(text, "mtllib ",
                    Absolute(library).lexically_proximate(folder).string(),
                    "\n");
  }
}

}  // namespace

absl::StatusOr<std::optional<MeshTexture>> ReadObjTexture(
    const std::string& path, const TriangleMesh& mesh) {
  if (LowerExtension(path) != ".obj") return std::nullopt;
  ISOMATCH_ASSIGN_OR_RETURN(ObjLines lines, ReadLines(path));
  if (lines.places.empty()) return std::nullopt;
  std::vector<CutTriangle> triangles;
  if (AreCuttable(lines, mesh.num_vertices())) {
    triangles = CutPolygons(lines.vertices, mesh.positions);
  }
  if (!AreFacesOf(lines, triangles, mesh.faces)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "'", path,
        "': texture coordinates cannot be read, expected one face a line, `f` "
        "and corners V/VT"));
  }
  MeshTexture texture = ToTexture(std::move(lines), triangles);
  if (texture.corners.maxCoeff() < 0) return std::nullopt;
  return texture;
}

std::string FormatObj(const std::string& path, const TriangleMesh& mesh,
                      const ObjExtras& extras) {
  std::string text;
  const MeshTexture* texture = extras.texture;
  if (texture != nullptr) AppendLibraries(path, *texture, &text);
  AppendVertices(mesh, extras.colors, &text);
  if (texture != nullptr) {
    for (Eigen::Index i = 0; i < texture->places.rows(); ++i) {
      text += "vt ";
      AppendNumber(texture->places(i, 0), &text);
      text += ' ';
      AppendNumber(texture->places(i, 1), &text);
      text += '\n';
    }
  }
  int material = -1;
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    if (texture != nullptr) {
      const int wanted = texture->material_of_face[static_cast<std::size_t>(f)];
      if (wanted != material) {
        absl::StrAppend(
            &text, "usemtl ",
            wanted < 0 ? kNoMaterial
                       : texture->materials[static_cast<std::size_t>(wanted)],
            "\n");
        material = wanted;
      }
    }
    text += 'f';
    for (int i = 0; i < 3; ++i) {
      AppendCorner(mesh.faces(f, i),
                   texture == nullptr ? -1 : texture->corners(f, i), &text);
    }
    text += '\n';
  }
  return text;
}

}  // namespace isomatch
