#include "core/base/file_bytes.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>

namespace isomatch {

int WriteAll(int file, absl::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = write(file, bytes.data(), bytes.size());
    if (written < 0 && errno != EINTR) return errno;
    if (written > 0) bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  return 0;
}

int ReadUpTo(std::size_t most, int file, std::string* bytes) {
  // By way of a block that stays in the processor's cache: to resize first
  // would be a pass over all memory, to fill it with zeros.
  std::array<char, std::size_t{1} << 16> block;
  bytes->clear();
  bytes->reserve(most);
  while (bytes->size() < most) {
    const ssize_t got =
        read(file, block.data(), std::min(block.size(), most - bytes->size()));
    if (got < 0 && errno != EINTR) return errno;
    if (got == 0) break;
    if (got > 0) bytes->append(block.data(), static_cast<std::size_t>(got));
  }
  return 0;
}

}  // namespace isomatch
