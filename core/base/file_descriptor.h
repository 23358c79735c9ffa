#pragma once

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <string>
#include <utility>

namespace isomatch {

/// Owns an open file or socket, or none.
class FileDescriptor {
 public:
  FileDescriptor() = default;
  explicit FileDescriptor(int file) : file_(file) {}
  ~FileDescriptor() { Close(); }

  /// As open(2), closed in programs that this one starts; what it makes only
  /// its owner can read. None when errno says why.
  static FileDescriptor Open(const std::string& path, int flags) {
    return FileDescriptor(
        open(path.c_str(), flags | O_CLOEXEC, S_IRUSR | S_IWUSR));
  }

  FileDescriptor(FileDescriptor&& other) noexcept
      : file_(std::exchange(other.file_, -1)) {}
  FileDescriptor& operator=(FileDescriptor&& other) noexcept {
    Close();
    file_ = other.Release();
    return *this;
  }

  bool is_open() const { return file_ >= 0; }
  int get() const { return file_; }
  /// Returns it for somebody else to close.
  int Release() { return std::exchange(file_, -1); }
  void Close() {
    if (file_ >= 0) close(Release());
  }

 private:
  int file_ = -1;
};

}  // namespace isomatch
