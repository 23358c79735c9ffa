#include "client/files/named_vertices.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "client/files/input_file.h"
#include "client/files/text_file.h"
#include "core/base/status_macros.h"
#include "core/mesh/mesh_geometry.h"

namespace isomatch {
namespace {

constexpr char kLandmarkLines[] = "landmarks: lines `VERTEX [NAME]`";

absl::StatusOr<NamedVertex> ParseLine(const std::string& path, int line,
                                      absl::string_view row,
                                      const std::vector<bool>& is_on_face) {
  const std::size_t end = std::min(row.find_first_of(" \t,"), row.size());
  NamedVertex found;
  const auto vertices = static_cast<VertexIndex>(is_on_face.size());
  if (!absl::SimpleAtoi(row.substr(0, end), &found.vertex) ||
      found.vertex < 0 || found.vertex >= vertices) {
    return LineError(
        path, line,
        absl::StrCat("VERTEX is ", row.substr(0, end), ", expected 0 to ",
                     vertices - 1, " (0-based)"));
  }
  if (!is_on_face[static_cast<std::size_t>(found.vertex)]) {
    return LineError(path, line,
                     absl::StrCat("VERTEX ", found.vertex,
                                  " is on no face, expected one of the "
                                  "surface"));
  }
  found.name = std::string(absl::StripAsciiWhitespace(row.substr(end)));
  return found;
}

}  // namespace

absl::StatusOr<std::vector<NamedVertex>> ReadNamedVertices(
    const std::string& path, const TriangleMesh& mesh) {
  ISOMATCH_ASSIGN_OR_RETURN(const InputFile file,
                            ReadInput(path, kLandmarkLines));
  const std::vector<bool> is_on_face = VerticesOnFaces(mesh);
  std::vector<NamedVertex> vertices;
  for (LineCursor rows = {file.bytes}; rows.Next();) {
    ISOMATCH_ASSIGN_OR_RETURN(
        NamedVertex vertex,
        ParseLine(path, rows.number, rows.line, is_on_face));
    vertices.push_back(std::move(vertex));
  }
  if (!vertices.empty()) return vertices;
  return absl::InvalidArgumentError(absl::StrCat(
      "'", path, "': no line of numbers, expected ", kLandmarkLines));
}

std::string FormatNamedVertices(absl::Span<const NamedVertex> vertices) {
  std::string text;
  for (const auto& [vertex, name] : vertices) {
    absl::StrAppend(&text, vertex, name.empty() ? "" : " ", name, "\n");
  }
  return text;
}

}  // namespace isomatch
