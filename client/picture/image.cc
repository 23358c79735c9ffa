#include "client/picture/image.h"

#include <png.h>

#include "absl/strings/str_cat.h"

namespace isomatch {
namespace {

absl::Status PngError(const png_image& image) {
  return absl::InternalError(
      absl::StrCat("libpng cannot encode: ", image.message));
}

}  // namespace

absl::StatusOr<std::string> EncodePng(const Image& image) {
  png_image header = {};
  header.version = PNG_IMAGE_VERSION;
  header.width = static_cast<png_uint_32>(image.width);
  header.height = static_cast<png_uint_32>(image.height);
  header.format = PNG_FORMAT_RGB;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(header);
  std::string bytes(size, '\0');
  if (png_image_write_to_memory(&header, bytes.data(), &size,
                                /*convert_to_8_bit=*/0, image.pixels.data(),
                                /*row_stride=*/0, /*colormap=*/nullptr) == 0) {
    return PngError(header);
  }
  bytes.resize(size);
  return bytes;
}

}  // namespace isomatch
