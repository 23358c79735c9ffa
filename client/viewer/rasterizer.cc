#include "client/viewer/rasterizer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include <Eigen/Geometry>

namespace isomatch {
namespace {

using Eigen::Array3d;
using Eigen::RowVector3d;

constexpr double kAmbient = 0.45;
constexpr double kDiffuse = 0.55;
constexpr double kGloss = 0.08;
constexpr double kGlossExponent = 40;
constexpr double kDark = 0.55;  // of a stripe

/// 0 in one half of a stripe's period, 1 in the other; `width` is how far `t`
/// moves in a pixel.
double Band(double t, double width) {
  const double wave = std::abs(t - std::floor(t) - 0.5) - 0.25;
  const double step =
      std::clamp((wave / std::max(width, 1e-4) + 1) / 2, 0.0, 1.0);
  return step * step * (3 - 2 * step);
}

/// What the pattern leaves of a color.
double PatternShade(Pattern pattern, const Array3d& place,
                    const Array3d& width) {
  if (pattern == Pattern::kPlain) return 1;
  const double first = Band(place[0], width[0]);
  if (pattern == Pattern::kStripes) return kDark + (1 - kDark) * first;
  const double product = (2 * first - 1) * (2 * Band(place[1], width[1]) - 1) *
                         (2 * Band(place[2], width[2]) - 1);
  return kDark + (1 - kDark) * (0.5 + 0.5 * product);
}

/// One face being drawn: its corners, and what changes from pixel to pixel.
class Face {
 public:
  Face(const DrawnSurface& surface, VertexIndex face) {
    for (int corner = 0; corner < 3; ++corner) {
      const VertexIndex v = surface.faces(face, corner);
      points_.row(corner) = surface.points.row(v);
      normals_.row(corner) = surface.normals.row(v);
      places_.row(corner) = surface.places.row(v);
      for (int channel = 0; channel < 3; ++channel) {
        colors_(corner, channel) = surface.colors[v][channel] / 255.0;
      }
    }
    const RowVector3d ab = points_.row(1) - points_.row(0);
    const RowVector3d ac = points_.row(2) - points_.row(0);
    const double doubled_area = ab[0] * ac[1] - ab[1] * ac[0];
    is_seen_ = std::abs(doubled_area) > 1e-12;
    if (!is_seen_) return;
    // Weights of the second and third corner are linear in column and row.
    gradient_ << ac[1], -ac[0], -ab[1], ab[0];
    gradient_ /= doubled_area;
    Eigen::Matrix<double, 2, 3> sides;
    sides << places_.row(1) - places_.row(0), places_.row(2) - places_.row(0);
    const Eigen::Matrix<double, 2, 3> moves = gradient_.transpose() * sides;
    place_width_ = moves.cwiseAbs().colwise().sum().transpose().array();
  }

  bool is_seen() const { return is_seen_; }

  /// First and last column (axis 0) or row (axis 1) whose middle may be
  /// covered.
  std::array<int, 2> Range(int axis, int end) const {
    const double low = points_.col(axis).minCoeff();
    const double high = points_.col(axis).maxCoeff();
    return {
        static_cast<int>(std::ceil(std::clamp(low - 0.5, 0.0, 1.0 * end))),
        static_cast<int>(std::floor(std::clamp(high - 0.5, -1.0, end - 1.0)))};
  }

  /// Weights of the corners at a pixel's middle, negative outside.
  RowVector3d Weights(int column, int row) const {
    const Eigen::Vector2d offset(column + 0.5 - points_(0, 0),
                                 row + 0.5 - points_(0, 1));
    const Eigen::Vector2d weights = gradient_ * offset;
    return {1 - weights[0] - weights[1], weights[0], weights[1]};
  }

  float Nearness(const RowVector3d& weights) const {
    return static_cast<float>(weights.dot(points_.col(2)));
  }

  Rgb Shade(const RowVector3d& weights, Pattern pattern) const {
    RowVector3d normal = (weights * normals_).normalized();
    if (normal[2] < 0) normal = -normal;
    static const RowVector3d kLight = RowVector3d(-0.35, 0.5, 1).normalized();
    static const RowVector3d kHalfway =
        RowVector3d(-0.18, 0.26, 1).normalized();
    const double light =
        kAmbient + kDiffuse * std::max(0.0, normal.dot(kLight));
    const double gloss =
        kGloss * std::pow(std::max(0.0, normal.dot(kHalfway)), kGlossExponent);
    const double pattern_shade = PatternShade(
        pattern, (weights * places_).transpose().array(), place_width_);
    const RowVector3d color = weights * colors_;
    Rgb shaded;
    for (int channel = 0; channel < 3; ++channel) {
      const double value = color[channel] * pattern_shade * light + gloss;
      shaded[channel] = static_cast<std::uint8_t>(
          std::lround(255 * std::clamp(value, 0.0, 1.0)));
    }
    return shaded;
  }

 private:
  Eigen::Matrix3d points_;
  Eigen::Matrix3d normals_;
  Eigen::Matrix3d places_;
  Eigen::Matrix3d colors_;
  Eigen::Matrix2d gradient_;
  Array3d place_width_;
  bool is_seen_ = false;
};

}  // namespace

void DrawSurface(const DrawnSurface& surface, Pattern pattern, Image& image) {
  std::vector<float> nearest(image.pixels.size(),
                             -std::numeric_limits<float>::infinity());
  for (VertexIndex f = 0; f < surface.faces.rows(); ++f) {
    const Face face(surface, f);
    if (!face.is_seen()) continue;
    const auto [left, right] = face.Range(0, image.width);
    const auto [top, bottom] = face.Range(1, image.height);
    for (int row = top; row <= bottom; ++row) {
      for (int column = left; column <= right; ++column) {
        const RowVector3d weights = face.Weights(column, row);
        if (weights.minCoeff() < 0) continue;
        float& depth =
            nearest[static_cast<std::size_t>(row) * image.width + column];
        const float nearness = face.Nearness(weights);
        if (nearness <= depth) continue;
        depth = nearness;
        image.At(column, row) = face.Shade(weights, pattern);
      }
    }
  }
}

Image HalfSize(const Image& image) {
  Image half(image.width / 2, image.height / 2, {});
  for (int row = 0; row < half.height; ++row) {
    for (int column = 0; column < half.width; ++column) {
      for (int channel = 0; channel < 3; ++channel) {
        const int sum = image.At(2 * column, 2 * row)[channel] +
                        image.At(2 * column + 1, 2 * row)[channel] +
                        image.At(2 * column, 2 * row + 1)[channel] +
                        image.At(2 * column + 1, 2 * row + 1)[channel];
        half.At(column, row)[channel] =
            static_cast<std::uint8_t>((sum + 2) / 4);
      }
    }
  }
  return half;
}

}  // namespace isomatch
