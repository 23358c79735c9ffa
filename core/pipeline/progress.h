#pragma once

#include <functional>

namespace isomatch {

/// The steps of Match in order; not every profile runs all of them.
enum class Stage {
  kPrepare,          ///< validation, cleaning, orientation
  kGeodesics,        ///< basis points and their distance fields (3.1)
  kSpectral,         ///< Laplace-Beltrami eigenpairs
  kSeeds,            ///< seed generator (3.5)
  kFirstInsertion,   ///< insertion and annealing (3.3.1, 3.4)
  kSecondInsertion,  ///< insertion to 70 % (3.3.2)
  kFinalSwapping,    ///< zero-temperature swaps of the worst matches (3.4)
  kDense,            ///< nearest neighbors in closeness space
  kZoomOut,          ///< spectral refinement
  kChoice,           ///< distinct maps laid out coarsely, one chosen
  kAlignment,        ///< elastic alignment of the chosen one
  kQuality,          ///< the map of all vertices, figures about it
};
inline constexpr int kNumStages = 12;

/// Lower-case words, e.g. "first insertion".
const char* StageName(Stage stage);

/// Where a running match stands. Both fractions are in [0, 1]; total_fraction
/// never falls. Each stage that runs reports 0 when it begins and 1 when it
/// has ended, before the next begins.
struct Progress {
  Stage stage;
  double stage_fraction;
  double total_fraction;
};

/// Called from one thread at a time, possibly not the caller's. Must be quick
/// and must not throw.
using ProgressCallback = std::function<void(const Progress&)>;

}  // namespace isomatch
