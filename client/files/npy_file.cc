#include "client/files/npy_file.h"

#include <algorithm>
#include <cstddef>
#include <limits>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

constexpr absl::string_view kMagic("\x93NUMPY", 6);
// Magic, version, and the header's length as version 1 has it.
constexpr std::size_t kPrefixBytes = 10;
// Shorter than any header.
constexpr std::size_t kMinBytes = 12;
// The numbers begin at a multiple of it.
constexpr std::size_t kAlignment = 64;
// Longer than any header of a plain array.
constexpr std::size_t kMaxHeaderBytes = 4096;

// Little-endian, of at most 8 bytes.
std::uint64_t ToUnsigned(absl::string_view bytes) {
  std::uint64_t value = 0;
  for (std::size_t i = bytes.size(); i-- > 0;) {
    value = value << 8 | static_cast<unsigned char>(bytes[i]);
  }
  return value;
}

absl::Status ByteError(const std::string& path, std::size_t byte,
                       const std::string& what) {
  return absl::InvalidArgumentError(
      absl::StrCat("'", path, "', byte ", byte, ": ", what));
}

// How the numbers are stored.
struct NpyType {
  std::size_t bytes = 0;
  bool is_signed = true;
};

struct NpyHeader {
  NpyType type;
  std::uint64_t count = 0;
  // Where the numbers begin.
  std::size_t end = 0;
};

// What stands after 'key': in the header, a Python dictionary.
absl::string_view ValueOf(absl::string_view header, const char* key) {
  for (const char quote : {'\'', '"'}) {
    const std::string quoted =
        absl::StrCat(std::string(1, quote), key, std::string(1, quote));
    const std::size_t found = header.find(quoted);
    if (found == absl::string_view::npos) continue;
    header.remove_prefix(found + quoted.size());
    const std::size_t colon = header.find(':');
    if (colon == absl::string_view::npos) return "";
    return absl::StripLeadingAsciiWhitespace(header.substr(colon + 1));
  }
  return "";
}

absl::StatusOr<NpyType> ParseType(const std::string& path,
                                  absl::string_view value) {
  const absl::string_view text =
      value.empty() ? value : value.substr(1, value.find(value[0], 1) - 1);
  if (text.size() == 3 && (text[0] == '<' || text[0] == '|') &&
      (text[1] == 'i' || text[1] == 'u') &&
      absl::StrContains("1248", text[2])) {
    return NpyType{static_cast<std::size_t>(text[2] - '0'), text[1] == 'i'};
  }
  return ByteError(
      path, kPrefixBytes,
      absl::StrCat("the array's type is ", value.substr(0, value.find(',')),
                   ", expected '<i8' or '<i4' (numpy int64 or "
                   "int32), or another integer"));
}

absl::StatusOr<std::uint64_t> ParseShape(const std::string& path,
                                         absl::string_view value) {
  absl::string_view inside = value.substr(0, value.find(')'));
  const bool is_tuple = absl::ConsumePrefix(&inside, "(");
  const std::vector<absl::string_view> sizes =
      absl::StrSplit(inside, ',', absl::SkipWhitespace());
  std::uint64_t count = 0;
  if (is_tuple && sizes.size() == 1 && absl::SimpleAtoi(sizes[0], &count)) {
    return count;
  }
  return ByteError(path, kPrefixBytes,
                   absl::StrCat("the array's shape is (", inside.substr(0, 40),
                                "), expected one dimension, e.g. (5000,)"));
}

absl::StatusOr<NpyHeader> ParseHeader(const std::string& path,
                                      absl::string_view bytes) {
  if (bytes.size() < kMinBytes || !absl::StartsWith(bytes, kMagic)) {
    return ByteError(path, 0, "expected a NumPy file, which begins \\x93NUMPY");
  }
  const int version = static_cast<unsigned char>(bytes[6]);
  if (version < 1 || version > 3) {
    return ByteError(path, 6,
                     absl::StrCat("the file's version is ", version,
                                  ", expected 1, 2 or 3"));
  }
  const std::size_t length_bytes = version == 1 ? 2 : 4;
  const std::size_t begin = 8 + length_bytes;
  const std::size_t length = ToUnsigned(bytes.substr(8, length_bytes));
  if (length > kMaxHeaderBytes || begin + length > bytes.size()) {
    return ByteError(
        path, 8,
        absl::StrCat("the header is ", length, " bytes long, expected at most ",
                     std::min(kMaxHeaderBytes, bytes.size() - begin)));
  }
  const absl::string_view text = bytes.substr(begin, length);
  NpyHeader header;
  header.end = begin + length;
  ISOMATCH_ASSIGN_OR_RETURN(header.type,
                            ParseType(path, ValueOf(text, "descr")));
  ISOMATCH_ASSIGN_OR_RETURN(header.count,
                            ParseShape(path, ValueOf(text, "shape")));
  return header;
}

std::int64_t ToSigned(std::uint64_t value, const NpyType& type) {
  const std::size_t unused_bits = 64 - 8 * type.bytes;
  if (!type.is_signed) return static_cast<std::int64_t>(value);
  return static_cast<std::int64_t>(value << unused_bits) >> unused_bits;
}

}  // namespace

std::string FormatNpy(absl::Span<const std::int64_t> values) {
  std::string header =
      absl::StrCat("{'descr': '<i8', 'fortran_order': False, 'shape': (",
                   values.size(), ",), }");
  const std::size_t used = kPrefixBytes + header.size() + 1;
  header.append((kAlignment - used % kAlignment) % kAlignment, ' ');
  header += '\n';
  std::string bytes(kMagic);
  bytes += '\x01';
  bytes += '\x00';
  bytes += static_cast<char>(header.size() & 0xff);
  bytes += static_cast<char>(header.size() >> 8);
  bytes += header;
  bytes.reserve(bytes.size() + 8 * values.size());
  for (const std::int64_t value : values) {
    for (int shift = 0; shift < 64; shift += 8) {
      bytes += static_cast<char>(static_cast<std::uint64_t>(value) >> shift);
    }
  }
  return bytes;
}

absl::StatusOr<std::vector<std::int64_t>> ParseNpy(const std::string& path,
                                                   absl::string_view bytes) {
  ISOMATCH_ASSIGN_OR_RETURN(const NpyHeader header, ParseHeader(path, bytes));
  const absl::string_view numbers = bytes.substr(header.end);
  const std::size_t size = header.type.bytes;
  if (numbers.size() % size != 0 || numbers.size() / size != header.count) {
    return ByteError(
        path, header.end,
        absl::StrCat("the file goes on for ", numbers.size(),
                     " bytes, expected ", header.count, " numbers of ", size));
  }
  std::vector<std::int64_t> values;
  values.reserve(header.count);
  for (std::size_t i = 0; i < header.count; ++i) {
    const std::uint64_t value = ToUnsigned(numbers.substr(i * size, size));
    constexpr std::uint64_t kLargest = std::numeric_limits<std::int64_t>::max();
    if (!header.type.is_signed && value > kLargest) {
      return ByteError(
          path, header.end + i * size,
          absl::StrCat("found ", value, ", expected at most ", kLargest));
    }
    values.push_back(ToSigned(value, header.type));
  }
  return values;
}

}  // namespace isomatch
