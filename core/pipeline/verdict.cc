#include "core/pipeline/verdict.h"

#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/torn_maps.h"

namespace isomatch {
namespace {

// Measured on good and bad pairs: core/EXPERIMENTS.md, "Verdict".
constexpr double kBadConfidence = 0.45;
constexpr double kGoodConfidence = 0.6;
constexpr double kMostAreaDistortion = 0.6;
constexpr double kLeastCoverage = 0.9;
/// The same where parts of one shape fit nearly as well.
constexpr double kLeastUnsureCoverage = 0.97;
constexpr double kLeastSymmetryConfidence = 0.3;
constexpr double kLeastRelationConfidence = 0.25;
/// Of overlaps: where less than this of both shapes is matched, most may have
/// been missed.
constexpr double kLeastOverlap = 0.5;

/// Area distortion (MapQuality) above which nearly all of a map is torn.
constexpr double kTornAreaDistortion = 2;

std::string Percent(double fraction) {
  return absl::StrCat(static_cast<int>(std::lround(100 * fraction)), " %");
}

std::string Confidence(const Correspondence& found) {
  return absl::StrCat("mean confidence ",
                      std::round(100 * found.quality.mean_confidence) / 100);
}

/// What of Y a part leaves free says nothing.
bool IsCovered(const Correspondence& found) {
  const double least =
      found.relation_confidence < 1 ? kLeastUnsureCoverage : kLeastCoverage;
  return found.relation != Relation::kWhole || found.quality.coverage >= least;
}

std::string Uncovered(const Correspondence& found) {
  return absl::StrCat("only ", Percent(found.quality.coverage),
                      " of the area of Y has a counterpart");
}

double MatchedShare(const Correspondence& found) {
  const auto n = static_cast<double>(found.y_from_x.size());
  return n > 0 ? 1 - found.quality.unmatched / n : 0;
}

bool IsSmallOverlap(const Correspondence& found) {
  return found.relation == Relation::kOverlap &&
         MatchedShare(found) < kLeastOverlap &&
         found.quality.coverage < kLeastOverlap;
}

std::string Stretched(const Correspondence& found) {
  return absl::StrCat(
      "faces change their area by a factor of ",
      std::round(10 * std::exp(found.quality.area_distortion)) / 10,
      " on average");
}

std::string Check(Relation relation) {
  switch (relation) {
    case Relation::kWhole:
      return "check that both are the same kind of shape and whole, or give "
             "known matches as landmarks";
    case Relation::kPartOfY:
      return "check that X is a part of Y, and whether both have one unit, or "
             "give known matches as landmarks";
    case Relation::kPartOfX:
      return "check that Y is a part of X, and whether both have one unit, or "
             "give known matches as landmarks";
    case Relation::kOverlap:
      return "check that both are parts of one shape and have one unit, or "
             "give known matches as landmarks";
    case Relation::kAuto:
      break;  // never a map's
  }
  return "give known matches as landmarks";
}

Verdict Bad(const Correspondence& found) {
  Verdict bad = {VerdictLevel::kBad, Confidence(found), {}};
  if (found.quality.area_distortion > kTornAreaDistortion) {
    absl::StrAppend(&bad.reason, ", the map is torn");
    bad.advice =
        "look for faces that do not hang together, and weld vertices that lie "
        "side by side";
    if (found.relation != Relation::kWhole) {
      absl::StrAppend(&bad.advice, "; ", Check(found.relation));
    }
  } else if (!IsCovered(found)) {
    absl::StrAppend(&bad.reason, ", ", Uncovered(found));
    bad.advice =
        "if one is a part of the other, match them as relation part-of-y or "
        "part-of-x; or give known matches as landmarks";
  } else {
    absl::StrAppend(&bad.reason, ", ", Stretched(found));
    bad.advice = Check(found.relation);
  }
  return bad;
}

Verdict Doubtful(std::string reason, std::string advice) {
  return {VerdictLevel::kDoubtful, std::move(reason), std::move(advice)};
}

}  // namespace

const char* VerdictName(VerdictLevel level) {
  switch (level) {
    case VerdictLevel::kGood:
      return "good";
    case VerdictLevel::kDoubtful:
      return "doubtful";
    case VerdictLevel::kBad:
      return "bad";
  }
  return "unknown";
}

Verdict VerdictOf(const Correspondence& found) {
  // What is not a number fails.
  const MapQuality& quality = found.quality;
  if (!(quality.mean_confidence >= kBadConfidence)) return Bad(found);
  if (found.scores.orientation_score < 0) {
    return Doubtful("the map is probably mirrored",
                    "give known matches as landmarks, at least one on a limb");
  }
  if (found.ended_early && found.relation_confidence == 0) {
    return Doubtful(
        "there was no time to take the shapes for parts of each other in "
        "another way",
        "allow more time, or say as relation what they are");
  }
  if (found.ended_early && found.symmetry_confidence == 0) {
    return Doubtful(
        "there was no time to compare the map with others, such as the "
        "mirrored one",
        "allow more time, or look whether left and right are exchanged");
  }
  // Then signs of error are missing, and confidence is too high.
  if (found.ended_early && found.scores.stretch == 0) {
    return Doubtful("there was no time to refine the map", "allow more time");
  }
  if (found.symmetry_confidence < kLeastSymmetryConfidence) {
    return Doubtful(
        "another map, as a rule the mirrored one, fits nearly as well",
        "look whether left and right are exchanged; one landmark on a limb "
        "decides it");
  }
  if (found.relation_confidence < kLeastRelationConfidence) {
    return Doubtful(
        "taken for parts of each other in another way, the shapes fit nearly "
        "as "
        "well",
        "look at the map; if it is wrong, say as relation what they are");
  }
  const std::string look = "look at the map where confidence is low";
  if (!IsCovered(found)) return Doubtful(Uncovered(found), look);
  if (IsSmallOverlap(found)) {
    return Doubtful(
        absl::StrCat("only ", Percent(MatchedShare(found)), " of X and ",
                     Percent(found.quality.coverage), " of Y are matched"),
        "look whether the shapes have more in common");
  }
  if (!(quality.area_distortion <= kMostAreaDistortion)) {
    return Doubtful(Stretched(found), look);
  }
  if (found.relation == Relation::kWhole && IsTorn(found.scores)) {
    return Doubtful("the map seems torn or turned in places", look);
  }
  if (!(quality.mean_confidence >= kGoodConfidence)) {
    return Doubtful(Confidence(found), look);
  }
  return {VerdictLevel::kGood, Confidence(found), {}};
}

}  // namespace isomatch
