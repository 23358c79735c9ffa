#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "client/viewer/pair_view.h"

namespace isomatch {

/// What a page may tell of a map beside the map itself.
struct ViewDetails {
  /// Empty: "X → Y", of their names.
  std::string title = {};
  /// As ViewRotation has it.
  std::optional<int> up = std::nullopt;
  /// The bytes of a REPORT.json, and what errors call it.
  std::optional<std::string> report = std::nullopt;
  std::string report_path = {};
  /// 0 to 1 for each vertex of X; empty for none.
  std::vector<float> confidence = {};
};

/// Completes a view that has meshes, names and map: title, colors by position,
/// rotation, the layers distortion and confidence, the figures of map and
/// report. A report's warnings replace the view's, which it repeats.
///
/// Errors as ParseReport.
absl::Status AddDetails(ViewDetails details, PairView& view);

}  // namespace isomatch
