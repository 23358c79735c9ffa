#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "absl/types/span.h"
#include "client/c/arguments.h"
#include "client/c/mapped_pair.h"
#include "client/c/objects.h"
#include "client/files/face_finder.h"
#include "client/files/place_file.h"
#include "client/viewer/page.h"
#include "client/viewer/pair_view.h"
#include "client/viewer/view_details.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

std::string TextOr(const char* text, const std::string& otherwise) {
  return text == nullptr ? otherwise : text;
}

std::vector<SurfacePoint> OnFaces(const MappedMeshes& meshes) {
  std::vector<SurfacePoint> points;
  if (meshes.precise.empty()) return points;
  const FaceFinder finder(meshes.y);
  points.reserve(meshes.precise.size());
  for (const PrecisePoint& place : meshes.precise) {
    points.push_back(finder.Find(place));
  }
  return points;
}

/// What a page marks as the partner: of precise places the heaviest vertex.
VertexMap PartnersOf(const MappedMeshes& meshes) {
  if (meshes.precise.empty()) return meshes.y_from_x;
  return PlacesOnY{.points = meshes.precise, .is_precise = true}
      .HeaviestVertices();
}

absl::StatusOr<std::string> MakePage(MappedMeshes meshes,
                                     const isomatch_page& page,
                                     const std::uint8_t* mask_y) {
  PairView view;
  view.precise = OnFaces(meshes);
  view.y_from_x = PartnersOf(meshes);
  view.x = {TextOr(page.name_x, "X"), std::move(meshes.x)};
  view.y = {TextOr(page.name_y, "Y"), std::move(meshes.y)};
  ViewDetails details = {.title = TextOr(page.title, ""),
                         .report_path = "report"};
  if (page.report != nullptr) details.report = page.report;
  if (page.confidence != nullptr) {
    details.confidence.assign(page.confidence,
                              page.confidence + view.y_from_x.size());
  }
  if (mask_y != nullptr) {
    const absl::Span<const std::uint8_t> mask(mask_y,
                                              view.y.mesh.num_vertices());
    // One of whole shapes tells nothing.
    if (std::find(mask.begin(), mask.end(), 0) != mask.end()) {
      view.matched_y.assign(mask.begin(), mask.end());
    }
  }
  ISOMATCH_RETURN_IF_ERROR(AddDetails(std::move(details), view));
  return FormatPage(view, {});
}

}  // namespace
}  // namespace isomatch

const char* isomatch_text_data(const isomatch_text* text) {
  return text->text.c_str();
}

std::int64_t isomatch_text_size(const isomatch_text* text) {
  return static_cast<std::int64_t>(text->text.size());
}

void isomatch_text_free(isomatch_text* text) { delete text; }

isomatch_status isomatch_page_make(const isomatch_mapped_pair* pair,
                                   const isomatch_page* page,
                                   isomatch_text** html,
                                   isomatch_error** error) {
  return isomatch_page_make_masked(pair, page, nullptr, html, error);
}

isomatch_status isomatch_page_make_masked(const isomatch_mapped_pair* pair,
                                          const isomatch_page* page,
                                          const std::uint8_t* mask_y,
                                          isomatch_text** html,
                                          isomatch_error** error) {
  *html = nullptr;
  return isomatch::Guarded(error, [&]() -> absl::Status {
    ISOMATCH_ASSIGN_OR_RETURN(isomatch::MappedMeshes meshes,
                              isomatch::MappedMeshesOf(*pair));
    ISOMATCH_ASSIGN_OR_RETURN(
        std::string made,
        isomatch::MakePage(std::move(meshes),
                           page == nullptr ? isomatch_page{} : *page, mask_y));
    *html = new isomatch_text{std::move(made)};
    return absl::OkStatus();
  });
}
