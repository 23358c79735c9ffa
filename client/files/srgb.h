#pragma once

#include <cmath>

namespace isomatch {

/// A channel of a color, [0, 1]: as screens and most files have it (sRGB, IEC
/// 61966-2-1), of one that light adds up in, as COLOR_0 of glTF is.
inline double SrgbFromLinear(double linear) {
  return linear <= 0.0031308 ? 12.92 * linear
                             : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

/// The inverse.
inline double LinearFromSrgb(double srgb) {
  return srgb <= 0.04045 ? srgb / 12.92 : std::pow((srgb + 0.055) / 1.055, 2.4);
}

}  // namespace isomatch
