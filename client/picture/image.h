#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/picture/colors.h"

namespace isomatch {

/// A picture, row by row from the top.
struct Image {
  int width = 0;
  int height = 0;
  std::vector<Rgb> pixels;

  Image() = default;
  Image(int columns, int rows, Rgb background)
      : width(columns),
        height(rows),
        pixels(static_cast<std::size_t>(columns) * rows, background) {}

  Rgb& At(int column, int row) {
    return pixels[static_cast<std::size_t>(row) * width + column];
  }
  const Rgb& At(int column, int row) const {
    return pixels[static_cast<std::size_t>(row) * width + column];
  }
};

/// Returns the image as a PNG file, the same bytes for the same image.
/// INTERNAL when libpng refuses.
absl::StatusOr<std::string> EncodePng(const Image& image);

}  // namespace isomatch
