#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "client/files/mesh_fault.h"
#include "client/files/polygon_soup.h"

namespace isomatch {

/// Calls `read` with each statement of an OBJ file and the 1-based line where
/// it begins: comments are left out, and a line that ends with a backslash goes
/// on in the next one. Returns the first error of `read`.
absl::Status ForEachObjStatement(
    absl::string_view text,
    absl::FunctionRef<absl::Status(int line, absl::string_view statement)>
        read);

/// Reads the vertices `v` and faces `f` of an OBJ file; numbers of vertices may
/// count back from the last one. Everything else is left out: texture, normals,
/// groups, materials, and the points and lines that modelling programs write
/// for loose vertices and edges. What OBJ does not have, and free-form
/// surfaces, are told in `warnings`.
///
/// Returns the first line that is wrong, if any. Time and memory are
/// proportional to the size of `text`.
std::optional<MeshFault> ReadObjSoup(absl::string_view text, PolygonSoup* soup,
                                     std::vector<std::string>* warnings);

}  // namespace isomatch
