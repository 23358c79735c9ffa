#include "client/files/mesh_file.h"

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "client/files/mesh_fault.h"
#include "client/files/obj_reader.h"
#include "client/files/off_reader.h"
#include "client/files/ply_file.h"
#include "client/files/ply_reader.h"
#include "client/files/polygon_soup.h"
#include "client/files/stl_reader.h"
#include "client/files/text_file.h"
#include "client/files/triangulation.h"
#include "core/base/status_macros.h"
#include "core/io/draco_mesh.h"

namespace isomatch {
namespace {

constexpr char kExpected[] = "a mesh in an .off, .obj, .ply or .stl file";

// What each format has, for the message when a file is refused.
const char* Grammar(const std::string& extension) {
  if (extension == ".off") {
    return "OFF, the counts, one vertex `x y z` a line, then one face `3 a b "
           "c` a line, 0-based and below the number of vertices";
  }
  if (extension == ".obj") {
    return "lines `v x y z` and `f a b c`, 1-based and up to the number of "
           "vertices";
  }
  if (extension == ".ply") {
    return "element vertex with x, y, z and element face with list "
           "vertex_indices";
  }
  return "triangles as ascii or binary STL has them";
}

absl::Status WithSubject(const std::string& subject,
                         const absl::Status& status) {
  return absl::Status(status.code(),
                      absl::StrCat(subject, ": ", status.message()));
}

absl::Status CheckExtension(const std::string& subject,
                            const std::string& extension) {
  for (const char* known : {".off", ".obj", ".ply", ".stl"}) {
    if (extension == known) return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrCat(
      subject, ": the extension is '", extension, "', expected ", kExpected));
}

absl::Status FaultError(const std::string& subject, const MeshFault& fault) {
  return absl::InvalidArgumentError(absl::StrCat(
      subject, fault.place.empty() ? "" : ", ", fault.place, ": ", fault.what));
}

// Reads points and polygons, each number checked.
absl::Status ReadSoup(const std::string& subject, const std::string& extension,
                      absl::string_view bytes, PolygonSoup* soup,
                      std::vector<std::string>* warnings) {
  std::optional<MeshFault> fault;
  if (extension == ".off") {
    fault = ReadOffSoup(bytes, soup);
  } else if (extension == ".obj") {
    fault = ReadObjSoup(bytes, soup, warnings);
  } else if (extension == ".ply") {
    fault = ReadPlySoup(bytes, soup);
  } else {
    fault = ReadStlSoup(bytes, soup);
  }
  return fault ? FaultError(subject, *fault) : absl::OkStatus();
}

absl::Status CheckSoup(const PolygonSoup& soup, const std::string& extension) {
  if (soup.points.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("no vertices, expected ", Grammar(extension)));
  }
  if (soup.polygons.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(
        "vertices but no faces, expected a surface: ", Grammar(extension)));
  }
  if (soup.points.size() > std::numeric_limits<VertexIndex>::max()) {
    return absl::InvalidArgumentError(absl::StrCat(
        soup.points.size(), " vertices, expected fewer than 2^31"));
  }
  for (std::size_t f = 0; f < soup.polygons.size(); ++f) {
    const std::vector<std::size_t>& polygon = soup.polygons[f];
    if (polygon.size() < 3) {
      return absl::InvalidArgumentError(
          absl::StrCat("face ", f, " (0-based) has ", polygon.size(),
                       " corners, expected 3 or more"));
    }
    for (const std::size_t v : polygon) {
      if (v < soup.points.size()) continue;
      return absl::InvalidArgumentError(absl::StrCat(
          "face ", f, " (0-based) names vertex ", static_cast<std::int64_t>(v),
          " (0-based), expected 0 to ", soup.points.size() - 1));
    }
  }
  return absl::OkStatus();
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

Positions ToPositions(const PolygonSoup& soup) {
  Positions positions(static_cast<Eigen::Index>(soup.points.size()), 3);
  for (std::size_t v = 0; v < soup.points.size(); ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      positions(static_cast<Eigen::Index>(v), axis) =
          soup.points[v][static_cast<std::size_t>(axis)];
    }
  }
  return positions;
}

Faces Triangulate(const PolygonSoup& soup, const Positions& positions) {
  const std::vector<CutTriangle> triangles =
      CutPolygons(soup.polygons, positions);
  Faces faces(static_cast<Eigen::Index>(triangles.size()), 3);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const std::vector<std::size_t>& polygon =
        soup.polygons[triangles[t].polygon];
    for (std::size_t i = 0; i < 3; ++i) {
      faces(static_cast<Eigen::Index>(t), static_cast<Eigen::Index>(i)) =
          static_cast<VertexIndex>(polygon[triangles[t].corners[i]]);
    }
  }
  return faces;
}

std::vector<std::string> Warnings(const PolygonSoup& soup,
                                  const std::string& extension) {
  std::vector<std::string> warnings;
  if (extension == ".stl") {
    warnings.push_back(absl::StrCat(
        "STL has no vertices of its own: corners at one place were joined to ",
        soup.points.size(), " vertices, numbered in order of first use"));
  }
  std::size_t polygons = 0;
  for (const auto& polygon : soup.polygons) polygons += polygon.size() > 3;
  if (polygons > 0) {
    warnings.push_back(absl::StrCat(
        polygons, " faces with more than 3 corners were cut into triangles"));
  }
  return warnings;
}

// Makes the mesh of what was read.
absl::Status UseSoup(const PolygonSoup& soup, const std::string& subject,
                     const std::string& extension, LoadedMesh* loaded) {
  if (const absl::Status status = CheckSoup(soup, extension); !status.ok()) {
    return WithSubject(subject, status);
  }
  loaded->mesh.positions = ToPositions(soup);
  loaded->mesh.faces = Triangulate(soup, loaded->mesh.positions);
  for (std::string& warning : Warnings(soup, extension)) {
    loaded->warnings.push_back(std::move(warning));
  }
  if (const absl::Status status = CheckSinglePrecision(loaded->mesh.positions);
      !status.ok()) {
    return WithSubject(subject, status);
  }
  return ValidateMesh(loaded->mesh, subject);
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
  const std::string subject = absl::StrCat(field, ": '", path, "'");
  const std::string extension = LowerExtension(path);
  if (const absl::Status status = CheckInputFile(path, kExpected);
      !status.ok()) {
    return WithSubject(field, status);
  }
  ISOMATCH_RETURN_IF_ERROR(CheckExtension(subject, extension));
  absl::StatusOr<std::string> bytes = ReadFile(path, kExpected);
  if (!bytes.ok()) return WithSubject(field, bytes.status());
  LoadedMesh loaded;
  PolygonSoup soup;
  ISOMATCH_RETURN_IF_ERROR(
      ReadSoup(subject, extension, *bytes, &soup, &loaded.warnings));
  ISOMATCH_RETURN_IF_ERROR(UseSoup(soup, subject, extension, &loaded));
  loaded.file_faces = loaded.mesh.faces;
  return loaded;
}

absl::Status CheckMeshOutput(const std::string& path) {
  const std::string extension = LowerExtension(path);
  if (extension != ".off" && extension != ".ply") {
    return absl::InvalidArgumentError(
        absl::StrCat("'", path, "': the extension is '", extension,
                     "', expected .off or .ply to write a mesh"));
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
  return WriteFileAtomically(
      path, LowerExtension(path) == ".ply" ? FormatPly(mesh) : FormatOff(mesh));
}

}  // namespace isomatch
