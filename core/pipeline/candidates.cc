#include "core/pipeline/candidates.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "core/matching/first_stage.h"

namespace isomatch {
namespace {

/// Below this, factors of the rank value are rounding.
constexpr double kPerfectSign = 1e-4;
/// Stands for a misfit that is not finite: X cannot be laid on Y at all.
constexpr double kEndlessSign = 1e6;
/// A map is given up that is so many times worse than the leading one by the
/// product of its first signs, and by normals and by movement alone this much.
/// Over 776 wrong maps no right one was behind by more than 1.43, nor by both:
/// core/EXPERIMENTS.md, "Choice among distinct maps".
constexpr double kFarBehind = 8;
constexpr double kWorse = 1.25;
/// How many times worse than the best a map that was given up is at least: the
/// nearest of those was.
constexpr double kLostBy = 1.6;

/// Dense maps are one where this much of X is in one place.
constexpr double kSameMap = 0.8;
/// One vertex in so many is looked at; what goes no farther apart, in
/// sqrt(area), is in one place.
constexpr std::size_t kEvery = 7;
constexpr float kSamePlace = 0.1f;

}  // namespace

double MisfitOf(const Candidate& candidate, bool oriented,
                const MatchOptions& options) {
  const MapScores& scores = candidate.scores;
  double misfit = LandmarkPenalty(scores.landmark_contradiction);
  const auto multiply = [&](double sign, double power) {
    const double factor =
        std::isfinite(sign) ? std::max(sign, kPerfectSign) : kEndlessSign;
    misfit *= std::pow(factor, power);
  };
  if (options.relation != Relation::kWhole) {
    multiply(scores.stretch, 1);
    if (oriented) multiply(scores.normal_mismatch, 1);
    multiply(scores.descriptor_mismatch, 1);
    return misfit;
  }
  multiply(scores.curvature_mismatch, 2 * options.curvature_weight);
  multiply(candidate.dense_mismatch, 4);
  multiply(candidate.first_signs.stretch, 1);
  multiply(oriented ? scores.normal_mismatch : scores.stretch, 1);
  multiply(scores.descriptor_mismatch, 2);
  return misfit;
}

bool IsFarBehind(const FirstSigns& signs, const FirstSigns& leading) {
  const auto ratio = [&](double FirstSigns::*sign) {
    return std::max(signs.*sign, kPerfectSign) /
           std::max(leading.*sign, kPerfectSign);
  };
  const double normals = ratio(&FirstSigns::normals);
  const double moved = ratio(&FirstSigns::moved);
  return normals * moved * ratio(&FirstSigns::stretch) > kFarBehind &&
         normals > kWorse && moved > kWorse;
}

bool RanksBefore(const Candidate& a, const Candidate& b) {
  return std::tie(a.is_lost, a.scores.rank_value) <
         std::tie(b.is_lost, b.scores.rank_value);
}

void RankLost(std::vector<Candidate>* candidates) {
  double least = kLostBy * candidates->front().scores.rank_value;
  for (Candidate& candidate : *candidates) {
    if (candidate.is_lost) candidate.scores.rank_value = least;
    least = std::max(least, candidate.scores.rank_value);
  }
}

double ShareInPlace(const BasisPoints& basis_y, const VertexMap& a,
                    const VertexMap& b) {
  std::size_t same = 0;
  std::size_t compared = 0;
  for (std::size_t x = 0; x < a.size(); x += kEvery, ++compared) {
    same += basis_y.LowerBound(a[x], b[x]) <= kSamePlace;
  }
  return static_cast<double>(same) / static_cast<double>(compared);
}

void DropMirrored(std::vector<Candidate>* candidates) {
  const auto mirrored = std::stable_partition(
      candidates->begin(), candidates->end(), [](const Candidate& candidate) {
        return candidate.scores.orientation_score >= 0;
      });
  if (mirrored != candidates->begin()) {
    candidates->erase(mirrored, candidates->end());
  }
}

void KeepFirst(std::size_t count, std::vector<Candidate>* candidates) {
  candidates->erase(candidates->begin() + static_cast<std::ptrdiff_t>(count),
                    candidates->end());
}

void DropRepeated(const BasisPoints& basis_y,
                  std::vector<Candidate>* candidates) {
  std::vector<Candidate> distinct;
  for (Candidate& candidate : *candidates) {
    if (std::none_of(distinct.begin(), distinct.end(),
                     [&](const Candidate& better) {
                       return ShareInPlace(basis_y, candidate.y_from_x,
                                           better.y_from_x) > kSameMap;
                     })) {
      distinct.push_back(std::move(candidate));
    }
  }
  *candidates = std::move(distinct);
}

double SymmetryConfidence(const MatchOptions& options,
                          const std::vector<Candidate>& candidates) {
  if (options.candidates == 1 || options.alignment_rounds == 0) return 0;
  if (candidates.size() < 2) return 1;
  return 1 - candidates[0].scores.rank_value / candidates[1].scores.rank_value;
}

}  // namespace isomatch
