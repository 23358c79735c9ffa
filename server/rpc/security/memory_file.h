#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "core/base/file_descriptor.h"

namespace isomatch {

/// A file that is in memory alone, for libraries that want a path. Its path
/// stays the same while its content is replaced in one step: who opens it gets
/// either all of the old or all of the new. Not thread-safe, readers apart.
class MemoryFile {
 public:
  /// UNAVAILABLE: the system has no file descriptor or no memory left; then the
  /// content is what it was.
  absl::Status Replace(absl::string_view bytes);

  /// Valid in this process, once Replace has succeeded, as long as this lives.
  std::string path() const;

 private:
  FileDescriptor file_;
};

}  // namespace isomatch
