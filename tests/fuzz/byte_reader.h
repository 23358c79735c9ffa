#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "absl/strings/string_view.h"

namespace isomatch {

/// Turns a fuzzer's bytes into choices, from the front; zeros when they are
/// used up, so that every input means something.
class ByteReader {
 public:
  ByteReader(const std::uint8_t* data, std::size_t size)
      : left_(reinterpret_cast<const char*>(data), size) {}

  bool empty() const { return left_.empty(); }

  std::uint8_t Byte() {
    if (left_.empty()) return 0;
    const char first = left_.front();
    left_.remove_prefix(1);
    return static_cast<std::uint8_t>(first);
  }

  /// Eight bytes, little-endian.
  std::uint64_t Number() {
    std::uint64_t number = 0;
    for (int shift = 0; shift < 64; shift += 8) {
      number |= std::uint64_t{Byte()} << shift;
    }
    return number;
  }

  /// Up to `size` bytes.
  std::string Text(std::size_t size) {
    std::string text(left_.substr(0, size));
    left_.remove_prefix(text.size());
    return text;
  }

 private:
  absl::string_view left_;
};

}  // namespace isomatch
