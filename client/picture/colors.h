#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Geometry>

#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// sRGB.
using Rgb = std::array<std::uint8_t, 3>;

/// Colors of a scale from its low end to its high one.
using Palette = std::array<Rgb, 256>;

/// Where there is no match or no value; no other color here is a mid gray.
inline constexpr Rgb kGray = {158, 158, 158};

/// Violet for little to yellow for much, of even steps in lightness.
Palette ConfidencePalette();

/// Pale yellow for none to dark red for much.
Palette ErrorPalette();

/// Blue below, white in the middle, red above.
Palette DistortionPalette();

/// Returns for each vertex a color that tells where it is, a smooth function
/// of its place in `box`: hue along the longest side, lightness along
/// the next, hue and chroma along the shortest. Near the middle, where legs and
/// left and right meet, it changes fastest. No plane through the box is a
/// mirror of the colors, so that a map that swaps left and right shows.
///
/// Does not depend on scale. A vertex outside has the color of the nearest
/// place inside.
std::vector<Rgb> PositionRgb(const Positions& positions,
                             const Eigen::AlignedBox3d& box);

}  // namespace isomatch
