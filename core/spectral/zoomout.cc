#include "core/spectral/zoomout.h"

#include <algorithm>
#include <utility>

#include "core/base/status_macros.h"
#include "core/spectral/functional_map.h"

namespace isomatch {

absl::StatusOr<VertexMap> ZoomOut(const SpectralBasis& spectral_x,
                                  const SpectralBasis& spectral_y,
                                  VertexMap y_from_x,
                                  const ZoomOutOptions& options,
                                  const std::function<void(double)>& progress,
                                  const std::stop_token& stop) {
  const int end = std::min({options.end, spectral_x.size(), spectral_y.size()});
  int k = std::min(options.start, end);
  const int iterations = (end - k + options.step - 1) / options.step + 1;
  for (int i = 0; i < iterations; ++i) {
    const Eigen::MatrixXd fmap_x_from_y =
        FunctionalMapFromVertexMap(spectral_x, spectral_y, y_from_x, k);
    ISOMATCH_ASSIGN_OR_RETURN(y_from_x,
                              VertexMapFromFunctionalMap(spectral_x, spectral_y,
                                                         fmap_x_from_y, stop));
    k = std::min(k + options.step, end);
    if (progress) progress(double(i + 1) / iterations);
  }
  return y_from_x;
}

}  // namespace isomatch
