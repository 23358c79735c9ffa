#include "client/files/obj_file.h"

#include <cstddef>
#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/files/obj_reader.h"
#include "client/files/text_file.h"

namespace isomatch {
namespace {

namespace fs = std::filesystem;

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

void AppendCorner(VertexIndex vertex, VertexIndex coordinates,
                  std::string* text) {
  absl::StrAppend(text, " ", vertex + 1);
  if (coordinates >= 0) absl::StrAppend(text, "/", coordinates + 1);
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

std::string FormatObj(const std::string& path, const TriangleMesh& mesh,
                      const ObjExtras& extras) {
  std::string text;
  const MeshTexture* texture = extras.texture;
  if (texture != nullptr) AppendLibraries(path, *texture, &text);
  AppendVertices(mesh, extras.colors, &text);
  if (texture != nullptr) {
    for (Eigen::Index i = 0; i < texture->coordinates.rows(); ++i) {
      text += "vt ";
      AppendNumber(texture->coordinates(i, 0), &text);
      text += ' ';
      AppendNumber(texture->coordinates(i, 1), &text);
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
