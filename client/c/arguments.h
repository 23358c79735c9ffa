#pragma once

#include <cstdint>
#include <exception>
#include <limits>
#include <new>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "client/c/isomatch.h"
#include "core/mesh/triangle_mesh.h"

// What the functions of isomatch.h take, and how they fail.

namespace isomatch {

/// The most vertices, or faces, of a mesh.
inline constexpr std::int64_t kMostElements =
    std::numeric_limits<std::int32_t>::max();

/// INVALID_ARGUMENT, "field: what".
absl::Status Invalid(absl::string_view field, absl::string_view what);

/// Makes of a status what C gets; `error` may be NULL.
isomatch_status Report(const absl::Status& status, isomatch_error** error);

/// Calls `call()`, which returns an absl::Status, and lets nothing out.
template <typename Call>
isomatch_status Guarded(isomatch_error** error, const Call& call) noexcept {
  if (error != nullptr) *error = nullptr;
  try {
    return Report(call(), error);
  } catch (const std::bad_alloc&) {
    return ISOMATCH_OUT_OF_MEMORY;  // nor is there any for an error
  } catch (const std::exception& thrown) {
    try {
      return Report(absl::InternalError(thrown.what()), error);
    } catch (...) {
      return ISOMATCH_INTERNAL;
    }
  }
}

/// The caller's mesh as it is. INVALID_ARGUMENT, whose field begins with
/// `field`: NULL, a count out of range, what ValidateMesh refuses.
absl::StatusOr<TriangleMesh> CopyOf(const isomatch_mesh* mesh,
                                    const std::string& field);

}  // namespace isomatch
