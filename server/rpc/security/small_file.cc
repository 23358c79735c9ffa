#include "server/rpc/security/small_file.h"

#include <fcntl.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstring>

#include "absl/strings/str_cat.h"
#include "core/base/file_bytes.h"
#include "core/base/file_descriptor.h"

namespace isomatch {
namespace {

constexpr size_t kMostBytes = size_t{1} << 20;

}  // namespace

absl::StatusOr<std::string> ReadSmallFile(absl::string_view field,
                                          const std::string& path) {
  const auto wrong = [&](absl::string_view found) {
    return absl::InvalidArgumentError(absl::StrCat(
        field, " = ", path, ", expected a readable file: ", found));
  };
  // Without O_NONBLOCK the open of a pipe would wait for its writer.
  const auto file = FileDescriptor::Open(path, O_RDONLY | O_NONBLOCK);
  struct stat about = {};
  if (!file.is_open() || fstat(file.get(), &about) != 0) {
    return wrong(std::strerror(errno));
  }
  if (!S_ISREG(about.st_mode)) return wrong("it is no regular file");
  std::string bytes;
  // One more than is allowed tells that there are too many.
  const int error = ReadUpTo(kMostBytes + 1, file.get(), &bytes);
  if (error != 0) return wrong(std::strerror(error));
  if (bytes.empty()) return wrong("it is empty");
  if (bytes.size() > kMostBytes) return wrong("it has more than 1 MiB");
  return bytes;
}

}  // namespace isomatch
