#include "core/pipeline/confidence.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace isomatch {
namespace {

/// Unit of the expected error, sqrt(area).
constexpr double kUnit = 0.05;
/// Expected error: what no sign tells, and per unit of each sign.
constexpr double kBase = 0.005;
constexpr double kPerMoved = 0.25;
constexpr double kPerResidual = 1.3;
constexpr double kPerOffset = 0.13;
/// Poses of one body differ by this much where the map is right.
constexpr double kUsualDistortion = 0.08;
constexpr double kPerDistortion = 1;
constexpr int kSmoothings = 5;

}  // namespace

std::vector<double> Smoothed(absl::Span<const float> values,
                             const VertexStars& stars, int rounds) {
  std::vector<double> current(values.begin(), values.end());
  std::vector<double> next(values.size());
  for (int round = 0; round < rounds; ++round) {
    for (std::size_t v = 0; v < values.size(); ++v) {
      const auto neighbors = stars.Neighbors(static_cast<VertexIndex>(v));
      double sum = 0;
      int known = 0;
      const auto add = [&](double value) {
        if (value < 0) return;
        sum += value;
        ++known;
      };
      add(current[v]);
      for (const VertexIndex neighbor : neighbors) add(current[neighbor]);
      next[v] = known > 0 ? sum / known : -1;
    }
    current.swap(next);
  }
  return current;
}

std::vector<float> ConfidenceOf(const ErrorSigns& signs,
                                const VertexStars& stars_x) {
  std::vector<double> expected(signs.distortions.size(), kBase);
  const auto add = [&](absl::Span<const float> sign, double usual,
                       double factor) {
    if (sign.empty()) return;
    const std::vector<double> smoothed = Smoothed(sign, stars_x, kSmoothings);
    for (std::size_t v = 0; v < expected.size(); ++v) {
      expected[v] += factor * std::max(0.0, smoothed[v] - usual);
    }
  };
  add(signs.distortions, kUsualDistortion, kPerDistortion);
  add(signs.moved, 0, kPerMoved);
  add(signs.residuals, 0, kPerResidual);
  add(signs.offsets, 0, kPerOffset);
  std::vector<float> confidence;
  confidence.reserve(expected.size());
  for (const double e : expected) {
    confidence.push_back(static_cast<float>(std::exp(-e / kUnit)));
  }
  return confidence;
}

double MeanConfidence(absl::Span<const float> confidence,
                      const VertexMap& y_from_x) {
  double sum = 0;
  std::int64_t matched = 0;
  for (std::size_t x = 0; x < confidence.size(); ++x) {
    if (y_from_x[x] == kNoVertex) continue;
    sum += confidence[x];
    ++matched;
  }
  return matched == 0 ? 0 : sum / static_cast<double>(matched);
}

}  // namespace isomatch
