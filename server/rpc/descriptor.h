#pragma once

#include <utility>

#include <unistd.h>

namespace isomatch {

/// Owns an open file or socket, or none.
class Descriptor {
 public:
  Descriptor() = default;
  explicit Descriptor(int file) : file_(file) {}
  ~Descriptor() { Close(); }

  Descriptor(Descriptor&& other) noexcept
      : file_(std::exchange(other.file_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
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
