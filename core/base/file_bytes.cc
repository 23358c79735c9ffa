#include "core/base/file_bytes.h"

#include <unistd.h>

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
  bytes->resize(most);
  std::size_t done = 0;
  while (done < most) {
    const ssize_t got = read(file, &(*bytes)[done], most - done);
    if (got < 0 && errno != EINTR) return errno;
    if (got == 0) break;
    if (got > 0) done += static_cast<std::size_t>(got);
  }
  bytes->resize(done);
  return 0;
}

}  // namespace isomatch
