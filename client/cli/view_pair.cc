#include "client/cli/view_pair.h"

#include <filesystem>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "client/files/input_file.h"
#include "client/files/map_file.h"
#include "client/files/mesh_file.h"
#include "client/files/mesh_input.h"
#include "client/files/place_file.h"
#include "client/files/vertex_colors.h"
#include "client/job/map_errors.h"
#include "client/job/part_files.h"
#include "client/viewer/figures.h"
#include "client/viewer/layers.h"
#include "client/viewer/view_details.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

namespace fs = std::filesystem;

std::optional<int> UpAxis(const std::string& up) {
  if (up.empty()) return std::nullopt;
  return up[0] - 'x';
}

/// Reads a mesh into `view`, with its warnings.
absl::StatusOr<LoadedMesh> LoadShown(const std::string& path,
                                     const std::string& field,
                                     const std::string& weld, NamedMesh& shown,
                                     PairView& view) {
  ISOMATCH_ASSIGN_OR_RETURN(LoadedMesh loaded, LoadMeshFile(path, field, weld));
  for (const std::string& warning : loaded.warnings) {
    view.warnings.push_back(absl::StrCat(field, ": ", warning));
  }
  shown = {fs::path(path).filename().string(), loaded.WithFileFaces()};
  return loaded;
}

absl::Status AddError(const ViewFiles& files, const Terminal& terminal,
                      const MappedPair& pair, const TriangleMesh& welded_y,
                      PairView& view) {
  TellWaiting(terminal, absl::StrCat("measuring geodesic errors of ",
                                     pair.mesh_x.num_vertices(), " vertices"));
  ISOMATCH_ASSIGN_OR_RETURN(
      const MapErrors errors,
      MeasureAgainstTruth(
          {pair.y_from_x, pair.precise, &pair.mesh_y.faces, &pair.mesh_x},
          welded_y, files.truth, terminal.stop));
  view.layers.push_back(ErrorLayer(pair, errors.direct));
  view.figures.push_back(
      ErrorFigures(errors.direct, errors.mirrored, errors.iou));
  return absl::OkStatus();
}

absl::StatusOr<ViewDetails> ReadDetails(const ViewFiles& files,
                                        VertexIndex vertices_x) {
  ViewDetails details = {.title = files.title,
                         .up = UpAxis(files.up),
                         .report_path = files.report};
  if (!files.report.empty()) {
    ISOMATCH_ASSIGN_OR_RETURN(
        InputFile report,
        ReadInput(files.report,
                  "a report that `isomatch match --report` wrote"));
    details.report = std::move(report.bytes);
  }
  if (!files.confidence.empty()) {
    ISOMATCH_ASSIGN_OR_RETURN(details.confidence,
                              ReadConfidence(files.confidence, vertices_x));
  }
  return details;
}

absl::StatusOr<std::vector<Rgb>> FileColors(const std::string& path,
                                            const std::string& field,
                                            const LoadedMesh& loaded) {
  ISOMATCH_RETURN_IF_ERROR(loaded.colors.status());
  const std::optional<Colors>& colors = *loaded.colors;
  if (!colors) {
    return absl::InvalidArgumentError(
        absl::StrCat(field, ": '", path,
                     "' has no vertex colors, which --file-colors shows"));
  }
  std::vector<Rgb> bytes;
  for (Eigen::Index v = 0; v < colors->rows(); ++v) {
    bytes.push_back(ColorBytes(colors->row(v)));
  }
  return bytes;
}

}  // namespace

void TellWaiting(const Terminal& terminal, const std::string& what) {
  if (terminal.is_interactive) {
    terminal.err << "isomatch: " << what << std::endl;
  }
}

absl::StatusOr<PairView> LoadPairView(const ViewFiles& files,
                                      const Terminal& terminal) {
  PairView view;
  ISOMATCH_ASSIGN_OR_RETURN(const LoadedMesh x,
                            LoadShown(files.x, "X", files.weld, view.x, view));
  ISOMATCH_ASSIGN_OR_RETURN(const LoadedMesh y,
                            LoadShown(files.y, "Y", files.weld, view.y, view));
  const TriangleMesh& mesh_x = view.x.mesh;
  const TriangleMesh& mesh_y = view.y.mesh;
  ISOMATCH_ASSIGN_OR_RETURN(
      PlacesOnY places, ReadPlaces(files.map, mesh_x.num_vertices(), mesh_y));
  view.y_from_x = places.HeaviestVertices();
  view.precise = std::move(places.on_faces);
  if (!files.mask_y.empty()) {
    ISOMATCH_ASSIGN_OR_RETURN(view.matched_y,
                              ReadMaskY(files.mask_y, mesh_y.num_vertices()));
  }
  ISOMATCH_ASSIGN_OR_RETURN(ViewDetails details,
                            ReadDetails(files, mesh_x.num_vertices()));
  ISOMATCH_RETURN_IF_ERROR(AddDetails(std::move(details), view));
  if (files.file_colors) {
    ISOMATCH_ASSIGN_OR_RETURN(view.colors_x, FileColors(files.x, "X", x));
    ISOMATCH_ASSIGN_OR_RETURN(view.colors_y, FileColors(files.y, "Y", y));
  }
  if (!files.truth.empty()) {
    const MappedPair pair = {mesh_x, mesh_y, view.y_from_x, view.precise,
                             view.matched_y};
    ISOMATCH_RETURN_IF_ERROR(AddError(files, terminal, pair, y.mesh, view));
  }
  return view;
}

}  // namespace isomatch
