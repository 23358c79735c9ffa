#include "client/viewer/view_details.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "client/picture/colors.h"
#include "client/viewer/figures.h"
#include "client/viewer/layers.h"
#include "core/base/status_macros.h"
#include "core/mesh/mesh_geometry.h"

namespace isomatch {

absl::Status AddDetails(ViewDetails details, PairView& view) {
  view.title = details.title.empty()
                   ? absl::StrCat(view.x.name, " \u2192 ", view.y.name)
                   : std::move(details.title);
  view.colors_y = PositionRgb(view.y.mesh.positions, BoxOfFaces(view.y.mesh));
  view.rotation = ViewRotation(view.x.mesh, view.y.mesh, details.up);
  const MappedPair pair = {view.x.mesh, view.y.mesh, view.y_from_x,
                           view.precise, view.matched_y};
  view.layers.push_back(DistortionLayer(pair));
  if (!details.confidence.empty()) {
    view.layers.push_back(ConfidenceLayer(pair, std::move(details.confidence)));
  }
  view.figures.push_back(MapFigures(view));
  if (!details.report) return absl::OkStatus();
  ISOMATCH_ASSIGN_OR_RETURN(
      ReportFigures report,
      ParseReport(details.report_path, *details.report,
                  view.x.mesh.num_vertices(), view.y.mesh.num_vertices()));
  for (FigureTable& table : report.tables) {
    view.figures.push_back(std::move(table));
  }
  view.warnings = std::move(report.warnings);
  return absl::OkStatus();
}

}  // namespace isomatch
