#include "client/picture/colors.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <numeric>

#include <Eigen/Core>

#include "absl/types/span.h"

namespace isomatch {
namespace {

std::uint8_t Byte(double unit) {
  return static_cast<std::uint8_t>(
      std::lround(255 * std::clamp(unit, 0.0, 1.0)));
}

/// Piecewise linear between anchors at equal distances.
Palette Between(absl::Span<const Rgb> anchors) {
  Palette palette;
  for (std::size_t i = 0; i < palette.size(); ++i) {
    const double place = static_cast<double>(i * (anchors.size() - 1)) /
                         static_cast<double>(palette.size() - 1);
    const std::size_t below =
        std::min(static_cast<std::size_t>(place), anchors.size() - 2);
    const double weight = place - static_cast<double>(below);
    for (int channel = 0; channel < 3; ++channel) {
      palette[i][channel] = Byte(((1 - weight) * anchors[below][channel] +
                                  weight * anchors[below + 1][channel]) /
                                 255);
    }
  }
  return palette;
}

/// From OKLCH (B. Ottosson, "A perceptual color space for image processing",
/// 2020) to sRGB; hue in radians.
Rgb FromOklch(double lightness, double chroma, double hue) {
  const double a = chroma * std::cos(hue);
  const double b = chroma * std::sin(hue);
  const Eigen::Array3d root(lightness + 0.3963377774 * a + 0.2158037573 * b,
                            lightness - 0.1055613458 * a - 0.0638541728 * b,
                            lightness - 0.0894841775 * a - 1.2914855480 * b);
  const Eigen::Vector3d lms = root.cube();
  const Eigen::Matrix3d rgb_from_lms{
      {4.0767416621, -3.3077115913, 0.2309699292},
      {-1.2684380046, 2.6097574011, -0.3413193965},
      {-0.0041960863, -0.7034186147, 1.7076147010}};
  Rgb color;
  for (int channel = 0; channel < 3; ++channel) {
    const double linear =
        std::clamp(rgb_from_lms.row(channel).dot(lms), 0.0, 1.0);
    color[channel] =
        Byte(linear <= 0.0031308 ? 12.92 * linear
                                 : 1.055 * std::pow(linear, 1 / 2.4) - 0.055);
  }
  return color;
}

/// [-1, 1] to itself, three times as steep in the middle.
double Steepened(double t) {
  constexpr double kSteepness = 2.9;
  return std::tanh(kSteepness * t) / std::tanh(kSteepness);
}

/// Returns the color of a place in the bounding box, whose coordinates run from
/// -1 to 1 along its longest, middle and shortest side.
Rgb PositionColor(double longest, double middle, double shortest) {
  constexpr double kDegree = std::numbers::pi / 180;
  const double side = Steepened(shortest);
  const double hue = (150 - 130 * longest + 32 * side) * kDegree;
  const double lightness = 0.74 + 0.10 * Steepened(middle) + 0.04 * side;
  const double chroma = 0.135 - 0.025 * side;
  return FromOklch(lightness, chroma, hue);
}

}  // namespace

Palette ConfidencePalette() {
  // Viridis, by S. van der Walt and N. Smith (CC0), at nine places.
  return Between({{{0x44, 0x01, 0x54},
                   {0x47, 0x2d, 0x7b},
                   {0x3b, 0x52, 0x8b},
                   {0x2c, 0x72, 0x8e},
                   {0x21, 0x91, 0x8c},
                   {0x28, 0xae, 0x80},
                   {0x5e, 0xc9, 0x62},
                   {0xad, 0xdc, 0x30},
                   {0xfd, 0xe7, 0x25}}});
}

Palette ErrorPalette() {
  return Between({{{0xff, 0xf4, 0xcd},
                   {0xfe, 0xc9, 0x73},
                   {0xf9, 0x8c, 0x3e},
                   {0xdb, 0x47, 0x27},
                   {0xa0, 0x17, 0x2c},
                   {0x52, 0x07, 0x37}}});
}

Palette DistortionPalette() {
  return Between({{{0x1b, 0x4f, 0xa8},
                   {0x7f, 0xae, 0xe0},
                   {0xf6, 0xf3, 0xee},
                   {0xee, 0x9a, 0x77},
                   {0xb2, 0x25, 0x2c}}});
}

std::vector<Rgb> PositionRgb(const Positions& positions,
                             const Eigen::AlignedBox3d& box) {
  const Eigen::Vector3d& low = box.min();
  const Eigen::Vector3d extent = box.sizes();
  std::array<int, 3> axes;
  std::iota(axes.begin(), axes.end(), 0);
  std::stable_sort(axes.begin(), axes.end(),
                   [&](int i, int j) { return extent[i] > extent[j]; });
  std::vector<Rgb> colors(positions.rows());
  for (Eigen::Index v = 0; v < positions.rows(); ++v) {
    std::array<double, 3> place = {0, 0, 0};
    for (int i = 0; i < 3; ++i) {
      const int axis = axes[i];
      if (!(extent[axis] > 0)) continue;
      const double part = (positions(v, axis) - low[axis]) / extent[axis];
      place[i] = 2 * std::clamp(part, 0.0, 1.0) - 1;
    }
    colors[v] = PositionColor(place[0], place[1], place[2]);
  }
  return colors;
}

}  // namespace isomatch
