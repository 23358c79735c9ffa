#include "server/rpc/security/small_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"

namespace isomatch {
namespace {

constexpr size_t kMostBytes = size_t{1} << 20;

/// Appends what is left of the file, at most one byte more than is allowed.
/// Returns an errno, 0 when all went well.
int ReadRest(int file, std::string& bytes) {
  bytes.resize(kMostBytes + 1);
  size_t size = 0;
  while (size < bytes.size()) {
    const ssize_t count = read(file, &bytes[size], bytes.size() - size);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return errno;
    if (count == 0) break;
    size += static_cast<size_t>(count);
  }
  bytes.resize(size);
  return 0;
}

}  // namespace

absl::StatusOr<std::string> ReadSmallFile(absl::string_view field,
                                          const std::string& path) {
  const auto wrong = [&](absl::string_view found) {
    return absl::InvalidArgumentError(absl::StrCat(
        field, " = ", path, ", expected a readable file: ", found));
  };
  // Without O_NONBLOCK the open of a pipe would wait for its writer.
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (file < 0) return wrong(std::strerror(errno));
  const absl::Cleanup closes = [file] { close(file); };
  struct stat about = {};
  if (fstat(file, &about) != 0) return wrong(std::strerror(errno));
  if (!S_ISREG(about.st_mode)) return wrong("it is no regular file");
  std::string bytes;
  const int error = ReadRest(file, bytes);
  if (error != 0) return wrong(std::strerror(error));
  if (bytes.empty()) return wrong("it is empty");
  if (bytes.size() > kMostBytes) return wrong("it has more than 1 MiB");
  return bytes;
}

}  // namespace isomatch
