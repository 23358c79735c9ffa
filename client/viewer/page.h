#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "client/viewer/pair_view.h"

namespace isomatch {

/// What a page shows first.
struct PageStart {
  /// "colors", or the id of a layer.
  std::string layer = "colors";
  /// "plain", "stripes" or "checker".
  std::string pattern = "plain";
};

/// The page without its data, built by client/viewer/build.js; in the binary.
absl::string_view PageTemplate();

/// Returns a text as HTML shows it, in elements and in quoted attributes.
std::string EscapeHtml(absl::string_view text);

/// Returns what the page's script reads (src/pair.js), as JSON:
///
/// - `title`, `summary`, `layer` and `pattern` (shown first), `figures`,
///   `warnings`; `verdict` (`level`, `reason`, `advice`), null where no figure
///   is called so; `explanations` of figures, by label;
/// - `x`, `y`: `name`, `vertices`, `faces`, `draco` (NormalizedPositions, 16
/// bits
///   a coordinate), `order` ("id" or "decoded", see core/io/draco_mesh.h);
/// - `rotation`, nine numbers row by row;
/// - `map`: y_from_x as little-endian int32; `colors`: 3 bytes a vertex of Y;
/// - `matched_y`, null unless it is known: a byte a vertex of Y, 0 for one
/// without
///   a counterpart;
/// - `precise`, null unless the map is: `corners`, three int32 a vertex of X,
///   and `weights`, three uint16, 65535 for 1;
/// - `layers`: `id`, `label`, `description`, `low`, `high`, `palette` (256 x 3
///   bytes), `range` (two numbers), `x` and `y`: uint16 a vertex, 0 to 65534
///   for the range's ends, 65535 for no value.
///
/// Bytes are base64. INTERNAL when Draco refuses a mesh.
absl::StatusOr<std::string> FormatPageData(const PairView& view,
                                           const PageStart& start);

/// Returns the page about what FormatPageData returned.
std::string PageWithData(absl::string_view title, absl::string_view data);

/// Returns the whole page, one HTML document that asks nothing of the network.
absl::StatusOr<std::string> FormatPage(const PairView& view,
                                       const PageStart& start);

}  // namespace isomatch
