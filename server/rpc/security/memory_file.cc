#include "server/rpc/security/memory_file.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/file_bytes.h"

namespace isomatch {

absl::Status MemoryFile::Replace(absl::string_view bytes) {
  FileDescriptor fresh(memfd_create("isomatch", MFD_CLOEXEC));
  // The number stays, and with it the path; what it stands for changes.
  if (!fresh.is_open() || WriteAll(fresh.get(), bytes) != 0 ||
      (file_.is_open() && dup3(fresh.get(), file_.get(), O_CLOEXEC) < 0)) {
    return absl::UnavailableError(
        absl::StrCat("no file in memory: ", std::strerror(errno)));
  }
  if (!file_.is_open()) file_ = std::move(fresh);
  return absl::OkStatus();
}

std::string MemoryFile::path() const {
  return absl::StrCat("/proc/self/fd/", file_.get());
}

}  // namespace isomatch
