#include "client/files/ply_file.h"

#include <cstdint>

#include "absl/strings/str_cat.h"

namespace isomatch {
namespace {

// The bytes of a value, as binary_little_endian has them on the machines we
// build for.
template <typename T>
void AppendBytes(std::string* bytes, T value) {
  bytes->append(reinterpret_cast<const char*>(&value), sizeof(value));
}

const char* TypeName(PlyColumn::Type type) {
  switch (type) {
    case PlyColumn::Type::kFloat:
      return "float";
    case PlyColumn::Type::kInt:
      return "int";
    case PlyColumn::Type::kUchar:
      return "uchar";
  }
  return "";  // not reached
}

void AppendValue(std::string* bytes, const PlyColumn& column, VertexIndex v) {
  const double value = column.value(v);
  switch (column.type) {
    case PlyColumn::Type::kFloat:
      return AppendBytes(bytes, static_cast<float>(value));
    case PlyColumn::Type::kInt:
      return AppendBytes(bytes, static_cast<std::int32_t>(value));
    case PlyColumn::Type::kUchar:
      return AppendBytes(bytes, static_cast<std::uint8_t>(value));
  }
}

}  // namespace

std::string FormatPly(const TriangleMesh& mesh,
                      absl::Span<const PlyColumn> columns) {
  std::string bytes =
      absl::StrCat("ply\nformat binary_little_endian 1.0\nelement vertex ",
                   mesh.num_vertices(),
                   "\nproperty float x\nproperty float y\nproperty float z\n");
  for (const PlyColumn& column : columns) {
    absl::StrAppend(&bytes, "property ", TypeName(column.type), " ",
                    column.name, "\n");
  }
  absl::StrAppend(&bytes, "element face ", mesh.num_faces(),
                  "\nproperty list uchar int vertex_indices\nend_header\n");
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      AppendBytes(&bytes, static_cast<float>(mesh.positions(v, axis)));
    }
    for (const PlyColumn& column : columns) AppendValue(&bytes, column, v);
  }
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    AppendBytes(&bytes, std::uint8_t{3});
    for (int i = 0; i < 3; ++i) AppendBytes(&bytes, mesh.faces(f, i));
  }
  return bytes;
}

}  // namespace isomatch
