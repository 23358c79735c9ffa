#pragma once

#include <functional>
#include <stop_token>
#include <utility>

namespace isomatch {

/// The steps of Match in order; not every profile runs all of them. The numbers
/// are those of the API and of records on disk: they never change, and a stage
/// that is added gets the next one.
enum class Stage {
  kPrepare = 1,          ///< validation, cleaning, orientation
  kGeodesics = 2,        ///< basis points and their distance fields (3.1)
  kSpectral = 3,         ///< Laplace-Beltrami eigenpairs
  kSeeds = 4,            ///< seed generator (3.5)
  kFirstInsertion = 5,   ///< insertion and annealing (3.3.1, 3.4)
  kSecondInsertion = 6,  ///< insertion to 70 % (3.3.2)
  kFinalSwapping = 7,    ///< zero-temperature swaps of the worst matches (3.4)
  kDense = 8,            ///< nearest neighbors in closeness space
  kZoomOut = 9,          ///< spectral refinement
  kChoice = 11,          ///< distinct maps laid out coarsely, one chosen
  kAlignment = 12,       ///< elastic alignment of the chosen one
  kQuality = 10,         ///< the map of all vertices, figures about it
};

/// In order.
inline constexpr Stage kStages[] = {
    Stage::kPrepare,       Stage::kGeodesics,      Stage::kSpectral,
    Stage::kSeeds,         Stage::kFirstInsertion, Stage::kSecondInsertion,
    Stage::kFinalSwapping, Stage::kDense,          Stage::kZoomOut,
    Stage::kChoice,        Stage::kAlignment,      Stage::kQuality};

/// Lower-case words, e.g. "first insertion".
const char* StageName(Stage stage);

/// Where a running match stands. Both fractions are in [0, 1]; total_fraction
/// never falls. Each stage that runs reports 0 when it begins and 1 when it
/// has ended, before the next begins.
struct Progress {
  Stage stage;
  double stage_fraction;
  double total_fraction;
  /// A whole map exists: MatchControl::hurry would make it the result. Once set
  /// it stays.
  bool has_map = false;
};

/// Called from one thread at a time, possibly not the caller's. Must be quick
/// and must not throw.
using ProgressCallback = std::function<void(const Progress&)>;

/// How a caller follows a match, and ends it.
struct MatchControl {
  ProgressCallback progress = {};
  /// Ends it without a result.
  std::stop_token stop = {};
  /// Ends it with the best whole map that it has, the first one at least: see
  /// Correspondence::ended_early. The default profile alone heeds it.
  std::stop_token hurry = {};

  /// The same, followed by another.
  MatchControl With(ProgressCallback other) const {
    return {std::move(other), stop, hurry};
  }
};

/// What a run is ended by; see MatchControl.
struct StopTokens {
  std::stop_token stop;
  std::stop_token hurry;
};

/// A stop that comes with either of them, while this lives.
class EitherStop {
 public:
  explicit EitherStop(const StopTokens& tokens)
      : on_stop_(tokens.stop, End{ends_}),
        on_hurry_(tokens.hurry, End{ends_}) {}
  std::stop_token token() const { return ends_.get_token(); }

 private:
  struct End {
    std::stop_source& ends;
    void operator()() const { ends.request_stop(); }
  };
  std::stop_source ends_;
  std::stop_callback<End> on_stop_;
  std::stop_callback<End> on_hurry_;
};

}  // namespace isomatch
