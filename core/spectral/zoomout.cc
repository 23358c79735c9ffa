#include "core/spectral/zoomout.h"

#include <algorithm>
#include <utility>

#include "core/base/status_macros.h"
#include "core/mesh/surface_samples.h"
#include "core/spectral/functional_map.h"

namespace isomatch {

absl::StatusOr<VertexMap> ZoomOut(const SpectralSurface& x,
                                  const SpectralSurface& y, VertexMap y_from_x,
                                  const ZoomOutOptions& options,
                                  const Control& control) {
  const int end = std::min({options.end, x.basis.size(), y.basis.size()});
  int k = std::min(options.start, end);
  const int iterations = (end - k + options.step - 1) / options.step + 1;
  for (int i = 0; i < iterations; ++i) {
    const Eigen::MatrixXd fmap_x_from_y =
        FunctionalMapFromVertexMap(x.basis, y.basis, y_from_x, k);
    const PointColumns columns_x = FunctionColumns(x.basis, k);
    const PointColumns columns_y = CarriedColumns(y.basis, fmap_x_from_y);
    ISOMATCH_ASSIGN_OR_RETURN(
        y_from_x,
        NearestOnSurface({x.stars, x.basis.mass, columns_x},
                         {y.stars, y.basis.mass, columns_y}, control.stop));
    k = std::min(k + options.step, end);
    if (control.progress) control.progress(double(i + 1) / iterations);
  }
  return y_from_x;
}

}  // namespace isomatch
