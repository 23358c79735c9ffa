// The only file that sees libpng.

#include "client/png_file.h"

#include <png.h>

#include <cassert>
#include <cstddef>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

namespace isomatch {

absl::StatusOr<std::string> FormatPng(const Picture& picture) {
  assert(picture.pixels.size() == 3 * static_cast<std::size_t>(picture.width) *
                                      static_cast<std::size_t>(picture.height));
  png_image image = {};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(picture.width);
  image.height = static_cast<png_uint_32>(picture.height);
  image.format = PNG_FORMAT_RGB;
  // First asked for its size, then written.
  std::string bytes;
  png_alloc_size_t size = 0;
  const auto write = [&](void* to) {
    return png_image_write_to_memory(&image, to, &size,
                                     /*convert_to_8_bit=*/0,
                                     picture.pixels.data(), /*row_stride=*/0,
                                     /*colormap=*/nullptr);
  };
  if (write(nullptr) != 0) {
    bytes.resize(size);
    if (write(bytes.data()) != 0) return bytes;
  }
  return absl::InternalError(
      absl::StrCat("the picture cannot be written as PNG: ", image.message));
}

}  // namespace isomatch
