#include "server/rpc/security/memory_file.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "absl/strings/str_cat.h"
#include "core/base/write_all.h"

namespace isomatch {
MemoryFile::~MemoryFile() {
  if (file_ >= 0) close(file_);
}

absl::Status MemoryFile::Replace(absl::string_view bytes) {
  const int fresh = memfd_create("isomatch", MFD_CLOEXEC);
  // The number stays, and with it the path; what it stands for changes.
  if (fresh < 0 || WriteAll(fresh, bytes) != 0 ||
      (file_ >= 0 && dup3(fresh, file_, O_CLOEXEC) < 0)) {
    const int error = errno;
    if (fresh >= 0) close(fresh);
    return absl::UnavailableError(
        absl::StrCat("no file in memory: ", std::strerror(error)));
  }
  if (file_ >= 0) {
    close(fresh);
  } else {
    file_ = fresh;
  }
  return absl::OkStatus();
}

std::string MemoryFile::path() const {
  return absl::StrCat("/proc/self/fd/", file_);
}

}  // namespace isomatch
