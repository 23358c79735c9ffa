#pragma once

#include <cstdint>
#include <memory>
#include <stop_token>
#include <string>
#include <utility>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/pipeline/match_options.h"

namespace isomatch {

/// A mesh and what matching needs to know of it alone: cleaned, decimated,
/// distance fields, eigenpairs, curvature, descriptors. Whoever matches one
/// mesh with many prepares it once. Cheap to copy; thread-safe.
class PreparedShape {
 public:
  struct Contents;
  explicit PreparedShape(std::shared_ptr<const Contents> contents)
      : contents_(std::move(contents)) {}
  const Contents& contents() const { return *contents_; }

 private:
  std::shared_ptr<const Contents> contents_;
};

/// The two shapes of a pair.
struct PreparedPair {
  PreparedShape x;
  PreparedShape y;
};

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
