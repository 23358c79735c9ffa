#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace isomatch {

/// A picture: `pixels` has 3 bytes, red green blue, for each of width x height
/// pixels, row by row from the top.
struct Picture {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> pixels;
};

/// Returns the bytes of a PNG file. REQUIRES: width, height > 0 and as many
/// pixels. INTERNAL when libpng refuses.
absl::StatusOr<std::string> FormatPng(const Picture& picture);

}  // namespace isomatch
