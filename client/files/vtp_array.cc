#include "client/files/vtp_array.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

namespace isomatch {
namespace {

// What zlib makes of a byte at most, rounded up.
constexpr std::size_t kMostRatio = 1040;

// The value of a letter of base64; -1 for none, -2 for padding, -3 for a blank.
int ValueOf(char letter) {
  if ('A' <= letter && letter <= 'Z') return letter - 'A';
  if ('a' <= letter && letter <= 'z') return letter - 'a' + 26;
  if ('0' <= letter && letter <= '9') return letter - '0' + 52;
  if (letter == '+') return 62;
  if (letter == '/') return 63;
  if (letter == '=') return -2;
  const bool is_blank =
      letter == ' ' || letter == '\n' || letter == '\t' || letter == '\r';
  return is_blank ? -3 : -1;
}

// The bytes of a text, one after another: as they are, or of base64, which may
// be padded in its middle, where VTK ends one part and begins another.
class ByteSource {
 public:
  ByteSource(absl::string_view text, bool is_base64)
      : text_(text), is_base64_(is_base64) {}

  // Whether `count` bytes may be left.
  bool MayHave(std::size_t count) const {
    return count <= held_.size() - next_ + text_.size();
  }

  // Takes `count` bytes; false when there are fewer.
  bool Take(std::size_t count, std::string* bytes) {
    if (!MayHave(count)) return false;
    if (!is_base64_) {
      *bytes = std::string(text_.substr(0, count));
      text_.remove_prefix(count);
      return true;
    }
    while (held_.size() - next_ < count) {
      if (!TakeGroup()) return false;
    }
    *bytes = held_.substr(next_, count);
    held_.erase(0, next_ + count);
    next_ = 0;
    return true;
  }

 private:
  // Four letters, three bytes.
  bool TakeGroup() {
    std::array<int, 4> values;
    for (int& value : values) {
      do {
        if (text_.empty()) return false;
        value = ValueOf(text_.front());
        text_.remove_prefix(1);
      } while (value == -3);
      if (value == -1) return false;
    }
    const auto padding = std::count(values.begin(), values.end(), -2);
    if (padding > 2) return false;
    std::uint32_t group = 0;
    for (const int value : values) {
      group = group << 6 | static_cast<std::uint32_t>(std::max(value, 0));
    }
    const std::array<char, 3> bytes = {static_cast<char>(group >> 16 & 0xff),
                                       static_cast<char>(group >> 8 & 0xff),
                                       static_cast<char>(group & 0xff)};
    held_.append(bytes.data(), static_cast<std::size_t>(3 - padding));
    return true;
  }

  absl::string_view text_;
  const bool is_base64_;
  std::string held_;
  std::size_t next_ = 0;
};

class BlockDecoder {
 public:
  BlockDecoder(absl::string_view text, bool is_base64,
               const VtpEncoding& encoding)
      : source_(text, is_base64), encoding_(encoding) {}

  std::optional<MeshFault> Decode(std::size_t expected, std::string* bytes) {
    if (encoding_.is_zlib) return Inflate(expected, bytes);
    std::vector<std::size_t> header;
    if (auto fault = TakeHeader(1, &header)) return fault;
    if (header[0] != expected) return WrongSize(header[0], expected);
    if (source_.Take(expected, bytes)) return std::nullopt;
    return Ends();
  }

 private:
  // The number of blocks, the size of each unpacked, that of the last one, 0
  // when it is whole, and the size of each packed.
  std::optional<MeshFault> Inflate(std::size_t expected, std::string* bytes) {
    std::vector<std::size_t> header;
    if (auto fault = TakeHeader(3, &header)) return fault;
    const auto [blocks, size, last] =
        std::array{header[0], header[1], header[2]};
    std::vector<std::size_t> packed;
    if (auto fault = TakeHeader(blocks, &packed)) return fault;
    const bool is_sane = size <= expected || blocks <= 1;
    const std::size_t total =
        blocks == 0 || !is_sane
            ? 0
            : (blocks - 1) * size + (last == 0 ? size : last);
    if (total != expected) return WrongSize(total, expected);
    if (!source_.MayHave(expected / kMostRatio)) return Ends();
    bytes->clear();
    for (std::size_t i = 0; i < blocks; ++i) {
      const std::size_t room = i + 1 < blocks || last == 0 ? size : last;
      std::string block;
      if (!source_.Take(packed[i], &block)) return Ends();
      std::string unpacked(std::min(room, expected), '\0');
      uLongf length = unpacked.size();
      const int code = uncompress(
          reinterpret_cast<Bytef*>(unpacked.data()), &length,
          reinterpret_cast<const Bytef*>(block.data()), block.size());
      if (code != Z_OK || length != room) {
        return MeshFault{"",
                         absl::StrCat("block ", i, " (0-based) is not ", room,
                                      " bytes packed by zlib, "
                                      "expected those")};
      }
      *bytes += unpacked;
    }
    return std::nullopt;
  }

  std::optional<MeshFault> TakeHeader(std::size_t count,
                                      std::vector<std::size_t>* numbers) {
    const std::size_t size = encoding_.header_bytes;
    std::string bytes;
    if (!source_.MayHave(count) || !source_.Take(count * size, &bytes)) {
      return Ends();
    }
    for (std::size_t i = 0; i < count; ++i) {
      std::string number = bytes.substr(i * size, size);
      if (encoding_.is_big_endian) std::reverse(number.begin(), number.end());
      std::uint64_t value = 0;
      std::memcpy(&value, number.data(), size);
      numbers->push_back(value);
    }
    return std::nullopt;
  }

  static MeshFault Ends() {
    return {"",
            "its bytes end early or are no base64, expected as many as its "
            "header says"};
  }

  static MeshFault WrongSize(std::size_t found, std::size_t expected) {
    return {"", absl::StrCat("its header claims ", found, " bytes, expected ",
                             expected)};
  }

  ByteSource source_;
  const VtpEncoding& encoding_;
};

}  // namespace

std::optional<MeshFault> DecodeVtpBlock(absl::string_view text, bool is_base64,
                                        const VtpEncoding& encoding,
                                        std::size_t expected,
                                        std::string* bytes) {
  return BlockDecoder(text, is_base64, encoding).Decode(expected, bytes);
}

}  // namespace isomatch
