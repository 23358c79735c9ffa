#pragma once

#include <string>

namespace isomatch {

struct Correspondence;

/// What a person would say who looked at a map. The values go to disk and never
/// change.
enum class VerdictLevel {
  kGood = 1,      ///< can be worked with
  kDoubtful = 2,  ///< should be looked at first
  kBad = 3,       ///< is wrong, nearly always
};

/// "good", "doubtful", "bad".
const char* VerdictName(VerdictLevel level);

/// A judgment without a truth.
struct Verdict {
  VerdictLevel level = VerdictLevel::kGood;
  /// Why, in one sentence without a full stop; of a good map, how good.
  std::string reason;
  /// What to do about it, likewise; empty for a good map.
  std::string advice;
};

/// Returns the verdict on `found`, from its mean confidence, area distortion,
/// coverage, orientation and the alternatives to it:
///
///   bad       mean confidence below 0.45
///   doubtful  mean confidence below 0.6, area distortion above 0.6, coverage
///             below 0.9, or 0.97 where relation confidence is below 1 (but for
///             parts; of overlaps less than half of both matched), symmetry
///             confidence below 0.3, relation confidence below 0.25, or a
///             negative orientation score
///   good      all others
///
/// core/EXPERIMENTS.md has how often that is right.
Verdict VerdictOf(const Correspondence& found);

}  // namespace isomatch
