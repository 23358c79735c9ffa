#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "client/viewer/pair_view.h"
#include "core/evaluation/geodesic_error.h"

namespace isomatch {

/// What a REPORT.json of `isomatch match` tells.
struct ReportFigures {
  /// "Quality" and "Run", of the fields that are there.
  std::vector<FigureTable> tables;
  std::vector<std::string> warnings;
};

/// Reads the bytes of a report about two meshes of so many vertices. Fields it
/// does not know are left out.
///
/// INVALID_ARGUMENT, naming `path` and line or field: not JSON, not an object,
/// a field of another type than match_report writes, other numbers of vertices.
absl::StatusOr<ReportFigures> ParseReport(const std::string& path,
                                          absl::string_view bytes,
                                          VertexIndex vertices_x,
                                          VertexIndex vertices_y);

/// "Map": what can be counted; how many vertices of X have an image, how much
/// of Y is reached, means of the layers.
FigureTable MapFigures(const PairView& view);

/// "Error against the truth"; against the mirrored truth too, where there is
/// one, and `iou` of the overlap.
FigureTable ErrorFigures(const GeodesicError& error,
                         const std::optional<GeodesicError>& mirrored,
                         std::optional<double> iou = {});

}  // namespace isomatch
