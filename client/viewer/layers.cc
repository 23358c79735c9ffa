#include "client/viewer/layers.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "core/evaluation/area_stretch.h"

namespace isomatch {
namespace {

/// 1, 2 or 5 times a power of ten, not below `value`.
double RoundScale(double value) {
  const double power = std::pow(10, std::floor(std::log10(value)));
  for (const double step : {1.0, 2.0, 5.0}) {
    if (value <= step * power) return step * power;
  }
  return 10 * power;
}

/// The end of the error's scale.
double ErrorScale(std::vector<float> errors) {
  constexpr double kInside = 0.98;
  constexpr double kLeast = 0.01;
  std::erase_if(errors, [](float error) { return std::isnan(error); });
  if (errors.empty()) return kLeast;
  const auto bound =
      errors.begin() + static_cast<std::ptrdiff_t>(
                           kInside * static_cast<double>(errors.size() - 1));
  std::nth_element(errors.begin(), bound, errors.end());
  return RoundScale(std::max(kLeast, double{*bound}));
}

std::vector<float> OnY(const ScalarLayer& layer, const MappedPair& pair) {
  return CarryToY(layer.on_x, pair.y_from_x, pair.mesh_y, pair.matched_y);
}

}  // namespace

ScalarLayer ConfidenceLayer(const MappedPair& pair,
                            std::vector<float> confidence) {
  ScalarLayer layer = {.id = "confidence",
                       .label = "Confidence",
                       .description = "0: do not trust this vertex's image.",
                       .palette = ConfidencePalette(),
                       .on_x = std::move(confidence)};
  for (std::size_t x = 0; x < layer.on_x.size(); ++x) {
    if (pair.y_from_x[x] == kNoVertex) {
      layer.on_x[x] = std::numeric_limits<float>::quiet_NaN();
    }
  }
  layer.on_y = OnY(layer, pair);
  return layer;
}

ScalarLayer ErrorLayer(const MappedPair& pair, const GeodesicError& error) {
  ScalarLayer layer = {.id = "error",
                       .label = "Error",
                       .description =
                           "Geodesic distance on Y from the true image, as a "
                           "fraction of Y's geodesic diameter.",
                       .palette = ErrorPalette(),
                       .on_x = error.of_vertex};
  for (float& value : layer.on_x) {
    if (value < 0) value = std::numeric_limits<float>::quiet_NaN();
  }
  layer.high = ErrorScale(layer.on_x);
  layer.on_y = OnY(layer, pair);
  return layer;
}

ScalarLayer DistortionLayer(const MappedPair& pair) {
  ScalarLayer layer = {
      .id = "distortion",
      .label = "Distortion",
      .description =
          "ln(area of the image / area on X), areas as fractions "
          "of the whole: 0 keeps area, 0.69 doubles it, \u22120.69 "
          "halves it.",
      .low = -1,
      .high = 1,
      .palette = DistortionPalette(),
      .on_x = pair.precise.empty()
                  ? LogAreaStretch(pair.mesh_x, pair.mesh_y, pair.y_from_x)
                  : LogAreaStretch(pair.mesh_x, pair.mesh_y, pair.precise)};
  layer.on_y = OnY(layer, pair);
  return layer;
}

}  // namespace isomatch
