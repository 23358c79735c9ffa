#pragma once

#include <cstdint>
#include <memory>
#include <stop_token>
#include <string>
#include <utility>
#include <variant>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/mesh/triangle_mesh.h"
#include "core/pipeline/match_options.h"

namespace isomatch {

/// A mesh that several hold and nobody changes; not null. Cheap to copy.
class SharedMesh {
 public:
  /// Implicit, so that a mesh can be given wherever a shared one is taken.
  SharedMesh(TriangleMesh mesh)
      : mesh_(std::make_shared<const TriangleMesh>(std::move(mesh))) {}

  /// Returns `mesh` itself, which has to outlive all copies of what is
  /// returned.
  static SharedMesh Borrowed(const TriangleMesh& mesh) {
    return SharedMesh(std::shared_ptr<const TriangleMesh>(
        std::shared_ptr<const TriangleMesh>(), &mesh));
  }

  const TriangleMesh& operator*() const { return *mesh_; }
  const TriangleMesh* operator->() const { return mesh_.get(); }

 private:
  explicit SharedMesh(std::shared_ptr<const TriangleMesh> mesh)
      : mesh_(std::move(mesh)) {}

  std::shared_ptr<const TriangleMesh> mesh_;
};

/// A mesh and what matching needs to know of it alone: cleaned, decimated,
/// distance fields, eigenpairs, curvature, descriptors. Whoever matches one
/// mesh with many prepares it once. A mesh of several large components, which
/// are matched one by one, is cleaned and split only: its components are
/// prepared when it is known what they are matched with, one pair at a time, so
/// that never more than two are held. Cheap to copy; thread-safe.
class PreparedShape {
 public:
  struct Contents;
  explicit PreparedShape(std::shared_ptr<Contents> contents)
      : contents_(std::move(contents)) {}

  const Contents& contents() const { return *contents_; }
  /// The same, to be changed, when no copy of this shape is left; or nullptr.
  Contents* own_contents() {
    if (contents_.use_count() != 1) return nullptr;
    // Counting once more comes after all that other holders did before they
    // let go, which reading the count alone does not.
    const std::shared_ptr<Contents> counted = contents_;
    return counted.get();
  }

 private:
  std::shared_ptr<Contents> contents_;
};

/// The two shapes of a pair.
struct PreparedPair {
  PreparedShape x;
  PreparedShape y;
};

/// What a prepared shape comes from: its mesh, or itself.
using ShapeSource = std::variant<SharedMesh, PreparedShape>;

/// Returns a short text, equal for options for which shapes are prepared alike,
/// to the last digit.
std::string PreparationText(const MatchOptions& options);

/// Returns an upper bound on the bytes the shape holds, its mesh included.
std::int64_t PreparedShapeBytes(const PreparedShape& shape);

/// A prepared shape as bytes, for ParsePreparedShape of the same version of
/// Isomatch: about 2.7 kB for each solved vertex and 48 bytes for each other.
std::string SerializePreparedShape(const PreparedShape& shape);

/// Reads what SerializePreparedShape wrote; cleaning and decimation are done
/// again. DATA_LOSS: cut off, changed, or of another version. CANCELLED after
/// `stop`.
absl::StatusOr<PreparedShape> ParsePreparedShape(absl::string_view bytes,
                                                 std::stop_token stop = {});

}  // namespace isomatch
