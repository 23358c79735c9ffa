#include "client/files/mesh_file.h"

#include <array>
#include <cstddef>
#include <filesystem>
#include <limits>
#include <tuple>
#include <utility>

#include "absl/algorithm/container.h"
#include "absl/functional/function_ref.h"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "absl/types/span.h"
#include "client/files/draco_reader.h"
#include "client/files/glb_file.h"
#include "client/files/gltf_reader.h"
#include "client/files/input_file.h"
#include "client/files/obj_reader.h"
#include "client/files/off_reader.h"
#include "client/files/ply_file.h"
#include "client/files/ply_reader.h"
#include "client/files/polygon_soup.h"
#include "client/files/stl_reader.h"
#include "client/files/text_file.h"
#include "client/files/vtk_reader.h"
#include "client/files/vtp_reader.h"
#include "core/base/status_macros.h"
#include "core/io/draco_mesh.h"

namespace isomatch {
namespace {

// Of standard input, to tell what it is.
constexpr std::size_t kMostLooked = std::size_t{1} << 16;

std::string Expected() {
  return absl::StrCat("a mesh: ", kMeshFiles, ", with .gz or without");
}

using Reader = std::optional<MeshFault> (*)(absl::string_view bytes,
                                            const std::string& folder,
                                            PolygonSoup* soup);

struct Format {
  absl::string_view extension;
  /// What it has, for the message when a file is refused.
  const char* grammar;
  Reader read;
};

// A reader of a file that names no others.
template <std::optional<MeshFault> (*Read)(absl::string_view, PolygonSoup*)>
std::optional<MeshFault> Alone(absl::string_view bytes, const std::string&,
                               PolygonSoup* soup) {
  return Read(bytes, soup);
}

constexpr auto kFormats = std::to_array<Format>(
    {{".off",
      "OFF, the counts, one vertex `x y z` a line, then one face `3 a b c` a "
      "line, 0-based and below the number of vertices",
      Alone<ReadOffSoup>},
     {".ply",
      "element vertex with x, y, z and element face with list vertex_indices",
      Alone<ReadPlySoup>},
     {".obj",
      "lines `v x y z` and `f a b c`, 1-based and up to the number of vertices",
      Alone<ReadObjSoup>},
     {".stl", "triangles as ascii or binary STL has them", Alone<ReadStlSoup>},
     {".glb", "a scene of glTF 2.0 with triangles", ReadGltfSoup},
     {".gltf", "a scene of glTF 2.0 with triangles", ReadGltfSoup},
     {".vtk", "POINTS and POLYGONS of a legacy VTK file", Alone<ReadVtkSoup>},
     {".vtp", "Points and Polys of PolyData", Alone<ReadVtpSoup>},
     {".drc", "a triangle mesh as Draco has it", Alone<ReadDracoSoup>}});

// The extension that a mesh would have, by its first bytes: for standard input.
absl::string_view ExtensionOfContent(absl::string_view bytes) {
  const absl::string_view text = absl::StripLeadingAsciiWhitespace(bytes);
  if (absl::StartsWith(bytes, "glTF")) return ".glb";
  if (absl::StartsWith(bytes, "DRACO")) return ".drc";
  if (absl::StartsWith(text, "# vtk DataFile")) return ".vtk";
  if (absl::StartsWith(text, "<")) return ".vtp";
  if (absl::StartsWith(text, "{")) return ".gltf";
  if (absl::StartsWith(text, "ply")) return ".ply";
  LineCursor lines = {text.substr(0, kMostLooked)};
  if (lines.Next()) {
    const absl::string_view word = SplitWords(lines.line).front();
    if (absl::EndsWith(word, "OFF")) return ".off";
    if (!absl::EqualsIgnoreCase(word, "solid") &&
        absl::c_all_of(lines.line, absl::ascii_isprint)) {
      return ".obj";
    }
  }
  return ".stl";
}

absl::Status WithSubject(const std::string& subject,
                         const absl::Status& status) {
  return absl::Status(status.code(),
                      absl::StrCat(subject, ": ", status.message()));
}

absl::Status FaultError(const std::string& subject, const MeshFault& fault) {
  return absl::InvalidArgumentError(absl::StrCat(
      subject, fault.where.empty() ? "" : ", ", fault.where, ": ", fault.what));
}

absl::Status CheckSoup(const PolygonSoup& soup, const char* grammar) {
  constexpr std::size_t kMost = std::numeric_limits<VertexIndex>::max();
  if (soup.points.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("no vertices, expected ", grammar));
  }
  if (soup.sizes.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("vertices but no faces, expected a surface: ", grammar));
  }
  if (soup.points.size() <= kMost && soup.corners.size() <= kMost) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat(soup.points.size(), " vertices and ", soup.corners.size(),
                   " corners of faces, expected fewer than 2^31 of each"));
}

const Format* FindFormat(absl::string_view extension) {
  const auto format = absl::c_find_if(kFormats, [&](const Format& known) {
    return known.extension == extension;
  });
  return format == kFormats.end() ? nullptr : &*format;
}

// The folder whose files those of `path` may name; "" for none.
std::string FolderOf(const std::string& path) {
  if (path == kStandardInput) return "";
  const std::string folder = std::filesystem::path(path).parent_path().string();
  return folder.empty() ? "." : folder;
}

// Reads what a file has, each number checked.
absl::StatusOr<PolygonSoup> ReadSoup(const std::string& path,
                                     const std::string& field) {
  const std::string subject = absl::StrCat(field, ": '", path, "'");
  if (const absl::Status status = CheckInput(path, Expected()); !status.ok()) {
    return WithSubject(field, status);
  }
  const bool is_file = path != kStandardInput;
  const std::string extension = LowerExtension(WithoutGz(path));
  if (is_file && FindFormat(extension) == nullptr) {
    return absl::InvalidArgumentError(
        absl::StrCat(subject, ": the extension is '", extension, "', expected ",
                     Expected()));
  }
  const absl::StatusOr<InputFile> file = ReadInput(path, Expected());
  if (!file.ok()) return WithSubject(field, file.status());
  const Format* const format =
      FindFormat(is_file ? file->extension : ExtensionOfContent(file->bytes));
  PolygonSoup soup;
  if (const auto fault = format->read(file->bytes, FolderOf(path), &soup)) {
    return FaultError(subject, *fault);
  }
  const absl::Status status = CheckSoup(soup, format->grammar);
  if (!status.ok()) return WithSubject(subject, status);
  return soup;
}

// Coordinates travel in single precision.
absl::Status CheckSinglePrecision(const Positions& positions) {
  for (Eigen::Index v = 0; v < positions.rows(); ++v) {
    const double largest = positions.row(v).cwiseAbs().maxCoeff();
    if (largest <= std::numeric_limits<float>::max()) continue;
    return absl::InvalidArgumentError(absl::StrCat(
        "vertex ", v, " (0-based) has a coordinate of size ", largest,
        ", expected at most ", std::numeric_limits<float>::max()));
  }
  return absl::OkStatus();
}

// The rows of a matrix, which has as many columns as each array entries.
template <typename Matrix, typename Row>
Matrix ToMatrix(const std::vector<Row>& rows) {
  return Eigen::Map<const Matrix>(rows.data()->data(),
                                  static_cast<Eigen::Index>(rows.size()),
                                  std::tuple_size_v<Row>);
}

// The corner from which a fan cuts the polygon whose corners these are: the
// first, or the second when a quadrilateral's other diagonal is shorter.
std::size_t FanStart(absl::Span<const VertexIndex> polygon,
                     const Positions& positions) {
  if (polygon.size() != 4) return 0;
  const auto squared = [&](std::size_t a, std::size_t b) {
    return (positions.row(polygon[a]) - positions.row(polygon[b]))
        .squaredNorm();
  };
  return squared(1, 3) < squared(0, 2) ? 1 : 0;
}

// Calls `use` with each triangle that the polygons are cut into, in order: the
// polygon, and which of all corners are the triangle's.
void ForEachTriangle(
    const PolygonSoup& soup, const Positions& positions,
    absl::FunctionRef<void(std::size_t, const std::array<std::size_t, 3>&)>
        use) {
  std::size_t first = 0;
  for (std::size_t p = 0; p < soup.sizes.size(); ++p) {
    const auto size = static_cast<std::size_t>(soup.sizes[p]);
    const std::size_t start = FanStart(
        absl::MakeConstSpan(soup.corners).subspan(first, size), positions);
    for (std::size_t i = 1; i + 1 < size; ++i) {
      use(p, {first + start, first + (start + i) % size,
              first + (start + i + 1) % size});
    }
    first += size;
  }
}

// What `of_corner` has for the corners of the triangles.
Faces Triangulate(const PolygonSoup& soup, const Positions& positions,
                  const std::vector<VertexIndex>& of_corner) {
  Faces faces(
      static_cast<Eigen::Index>(soup.corners.size() - 2 * soup.sizes.size()),
      3);
  Eigen::Index t = 0;
  ForEachTriangle(soup, positions,
                  [&](std::size_t, const std::array<std::size_t, 3>& corners) {
                    faces.row(t++) << of_corner[corners[0]],
                        of_corner[corners[1]], of_corner[corners[2]];
                  });
  return faces;
}

absl::StatusOr<std::optional<Colors>> ToColors(const std::string& path,
                                               const PolygonSoup& soup) {
  if (soup.color_fault) {
    return FaultError(absl::StrCat("'", path, "'"), *soup.color_fault);
  }
  if (soup.colors.empty()) return std::nullopt;
  return ToMatrix<Colors>(soup.colors);
}

absl::StatusOr<std::optional<MeshTexture>> ToTexture(const std::string& path,
                                                     const Positions& positions,
                                                     PolygonSoup& soup) {
  if (soup.texture_fault) {
    return FaultError(absl::StrCat("'", path, "'"), *soup.texture_fault);
  }
  SoupTexture& found = soup.texture;
  if (found.coordinates_of_corner.empty()) return std::nullopt;
  found.coordinates_of_corner.resize(soup.corners.size(), -1);
  found.material_of_polygon.resize(soup.sizes.size(), -1);
  MeshTexture texture;
  texture.coordinates = ToMatrix<MeshTexture::Coordinates>(found.coordinates);
  texture.corners = Triangulate(soup, positions, found.coordinates_of_corner);
  ForEachTriangle(soup, positions, [&](std::size_t polygon, const auto&) {
    texture.material_of_face.push_back(found.material_of_polygon[polygon]);
  });
  texture.materials = std::move(found.materials);
  for (const std::string& library : found.libraries) {
    texture.libraries.push_back(
        (std::filesystem::path(path).parent_path() / library).string());
  }
  for (SoupImage& image : found.images) {
    texture.images.push_back({std::move(image.path), std::move(image.bytes)});
  }
  texture.image_of_material = std::move(found.image_of_material);
  return texture;
}

std::string FormatOff(const TriangleMesh& mesh) {
  std::string text =
      absl::StrCat("OFF\n", mesh.num_vertices(), " ", mesh.num_faces(), " 0\n");
  for (Eigen::Index v = 0; v < mesh.positions.rows(); ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      AppendNumber(mesh.positions(v, axis), &text);
      text += axis < 2 ? ' ' : '\n';
    }
  }
  for (Eigen::Index f = 0; f < mesh.faces.rows(); ++f) {
    absl::StrAppend(&text, "3 ", mesh.faces(f, 0), " ", mesh.faces(f, 1), " ",
                    mesh.faces(f, 2), "\n");
  }
  return text;
}

}  // namespace

absl::StatusOr<LoadedMesh> ReadMesh(const std::string& path,
                                    const std::string& field) {
  ISOMATCH_ASSIGN_OR_RETURN(PolygonSoup soup, ReadSoup(path, field));
  const std::string subject = absl::StrCat(field, ": '", path, "'");
  LoadedMesh loaded;
  loaded.format = std::move(soup.format);
  loaded.warnings = std::move(soup.warnings);
  TriangleMesh& mesh = loaded.mesh;
  mesh.positions = ToMatrix<Positions>(std::exchange(soup.points, {}));
  mesh.faces = Triangulate(soup, mesh.positions, soup.corners);
  const auto polygons =
      absl::c_count_if(soup.sizes, [](VertexIndex size) { return size > 3; });
  if (polygons > 0) {
    loaded.warnings.push_back(absl::StrCat(
        polygons, " faces with more than 3 corners were cut into triangles"));
  }
  if (const absl::Status status = CheckSinglePrecision(mesh.positions);
      !status.ok()) {
    return WithSubject(subject, status);
  }
  ISOMATCH_RETURN_IF_ERROR(ValidateMesh(mesh, subject));
  loaded.colors = ToColors(path, soup);
  loaded.texture = ToTexture(path, mesh.positions, soup);
  return loaded;
}

std::vector<std::string> MeshExtensions() {
  std::vector<std::string> extensions;
  extensions.reserve(std::size(kFormats));
  for (const Format& format : kFormats) {
    extensions.emplace_back(format.extension);
  }
  return extensions;
}

absl::Status CheckMeshOutput(const std::string& path) {
  const std::string extension = LowerExtension(path);
  if (extension != ".off" && extension != ".ply" && extension != ".glb") {
    return absl::InvalidArgumentError(
        absl::StrCat("'", path, "': the extension is '", extension,
                     "', expected .off, .ply or .glb to write a mesh"));
  }
  return CheckOutputFile(path);
}

TriangleMesh AsSent(const TriangleMesh& mesh) {
  return {(mesh.positions.rowwise() - SentOriginOf(mesh))
              .cast<float>()
              .cast<double>(),
          mesh.faces};
}

absl::Status WriteMesh(const std::string& path, const TriangleMesh& mesh) {
  ISOMATCH_RETURN_IF_ERROR(CheckMeshOutput(path));
  const std::string extension = LowerExtension(path);
  return WriteFileAtomically(path, extension == ".ply"   ? FormatPly(mesh)
                                   : extension == ".glb" ? FormatGlb(mesh, {})
                                                         : FormatOff(mesh));
}

}  // namespace isomatch
