#include "client/c/arguments.h"

#include <cstring>
#include <tuple>

#include "absl/strings/str_cat.h"
#include "client/c/objects.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

isomatch_status StatusOf(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kOk:
      return ISOMATCH_OK;
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kNotFound:  // a file that the caller names
      return ISOMATCH_INVALID_ARGUMENT;
    case absl::StatusCode::kCancelled:
      return ISOMATCH_CANCELLED;
    case absl::StatusCode::kResourceExhausted:
      return ISOMATCH_OUT_OF_MEMORY;
    default:
      return ISOMATCH_INTERNAL;
  }
}

/// What the core's messages begin with: "mesh_x: ...".
std::string FieldOf(absl::string_view message) {
  const absl::string_view field = message.substr(0, message.find(':'));
  const bool is_field =
      field.size() < message.size() &&
      field.find_first_not_of("abcdefghijklmnopqrstuvwxyz_0123456789.[]") ==
          absl::string_view::npos;
  return is_field ? std::string(field) : "";
}

}  // namespace

absl::Status Invalid(absl::string_view field, absl::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat(field, ": ", what));
}

isomatch_status Report(const absl::Status& status, isomatch_error** error) {
  const isomatch_status code = StatusOf(status);
  if (code == ISOMATCH_OK || error == nullptr) return code;
  const bool names_field = code == ISOMATCH_INVALID_ARGUMENT;
  *error = new isomatch_error{code, std::string(status.message()),
                              names_field ? FieldOf(status.message()) : ""};
  return code;
}

absl::StatusOr<TriangleMesh> CopyOf(const isomatch_mesh* mesh,
                                    const std::string& field) {
  if (mesh == nullptr) return Invalid(field, "NULL, expected a mesh");
  for (const auto& [count, name, data] :
       {std::tuple(mesh->num_vertices, "vertices",
                   static_cast<const void*>(mesh->positions)),
        std::tuple(mesh->num_faces, "faces",
                   static_cast<const void*>(mesh->faces))}) {
    if (count < 0 || count > kMostElements) {
      return Invalid(field, absl::StrCat(count, " ", name, ", expected 0 to ",
                                         kMostElements));
    }
    if (count > 0 && data == nullptr) {
      return Invalid(field, absl::StrCat("NULL, expected ", count, " ", name));
    }
  }
  TriangleMesh own;
  own.positions.resize(mesh->num_vertices, 3);
  own.faces.resize(mesh->num_faces, 3);
  if (mesh->num_vertices > 0) {
    std::memcpy(
        own.positions.data(), mesh->positions,
        sizeof(double) * static_cast<std::size_t>(own.positions.size()));
  }
  if (mesh->num_faces > 0) {
    std::memcpy(
        own.faces.data(), mesh->faces,
        sizeof(std::int32_t) * static_cast<std::size_t>(own.faces.size()));
  }
  ISOMATCH_RETURN_IF_ERROR(ValidateMesh(own, field));
  return own;
}

}  // namespace isomatch
