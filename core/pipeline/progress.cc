#include "core/pipeline/progress.h"

namespace isomatch {

const char* StageName(Stage stage) {
  switch (stage) {
    case Stage::kPrepare:
      return "prepare";
    case Stage::kGeodesics:
      return "geodesics";
    case Stage::kSpectral:
      return "spectral";
    case Stage::kSeeds:
      return "seeds";
    case Stage::kFirstInsertion:
      return "first insertion";
    case Stage::kSecondInsertion:
      return "second insertion";
    case Stage::kFinalSwapping:
      return "final swapping";
    case Stage::kDense:
      return "dense";
    case Stage::kZoomOut:
      return "zoomout";
    case Stage::kChoice:
      return "choice";
    case Stage::kAlignment:
      return "alignment";
    case Stage::kQuality:
      return "quality";
  }
  return "unknown";
}

}  // namespace isomatch
