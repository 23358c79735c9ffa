#include "client/mesh_claims.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

using Words = std::vector<absl::string_view>;

// The shortest that can be written in text: "0 0 0\n" and "3 0 1 2".
constexpr std::int64_t kOffVertexBytes = 6;
constexpr std::int64_t kOffFaceBytes = 7;

constexpr std::int64_t kMaxCount = std::numeric_limits<std::int32_t>::max();

Words SplitWords(absl::string_view text) {
  return absl::StrSplit(text, absl::ByAnyChar(" \t\r\n"), absl::SkipEmpty());
}

absl::StatusOr<std::int64_t> ParseCount(absl::string_view word,
                                        const std::string& of) {
  std::int64_t count = 0;
  if (absl::SimpleAtoi(word, &count) && count >= 0 && count <= kMaxCount) {
    return count;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("the header's number of ", of, " is '", word.substr(0, 40),
                   "', expected 0 to ", kMaxCount));
}

absl::Status CheckFits(const std::string& claim, std::int64_t needed_bytes,
                       std::int64_t file_bytes) {
  if (needed_bytes <= file_bytes) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("the header claims ", claim, ", which takes at least ",
                   needed_bytes, " bytes, but the file has ", file_bytes));
}

// The first words of an OFF file, without comments.
Words OffWords(absl::string_view head) {
  Words words;
  for (const absl::string_view line : absl::StrSplit(head, '\n')) {
    const Words of_line = SplitWords(line.substr(0, line.find('#')));
    words.insert(words.end(), of_line.begin(), of_line.end());
    if (words.size() >= 4) break;
  }
  return words;
}

// How the numbers after a PLY header are written.
enum class PlyFormat { kAscii, kLittleEndian, kBigEndian };

// Of one element: a number, or a list of numbers that begins with their count.
struct PlyProperty {
  int number_bytes = 0;
  // 0 for a single number.
  int count_bytes = 0;
};

struct PlyElement {
  std::string name;
  std::int64_t count = 0;
  std::vector<PlyProperty> properties;
};

struct PlyHeader {
  PlyFormat format = PlyFormat::kAscii;
  std::vector<PlyElement> elements;
};

absl::StatusOr<int> PlyTypeBytes(absl::string_view type) {
  static constexpr std::array<std::pair<absl::string_view, int>, 16> kBytes = {{
      {"char", 1},
      {"int8", 1},
      {"uchar", 1},
      {"uint8", 1},
      {"short", 2},
      {"int16", 2},
      {"ushort", 2},
      {"uint16", 2},
      {"int", 4},
      {"int32", 4},
      {"uint", 4},
      {"uint32", 4},
      {"float", 4},
      {"float32", 4},
      {"double", 8},
      {"float64", 8},
  }};
  for (const auto& [name, bytes] : kBytes) {
    if (type == name) return bytes;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("the header's type '", type.substr(0, 40),
                   "' is unknown, expected e.g. float or int"));
}

absl::StatusOr<PlyFormat> ParsePlyFormat(absl::string_view word) {
  if (word == "ascii") return PlyFormat::kAscii;
  if (word == "binary_little_endian") return PlyFormat::kLittleEndian;
  if (word == "binary_big_endian") return PlyFormat::kBigEndian;
  return absl::InvalidArgumentError(
      absl::StrCat("the header's format is '", word.substr(0, 40),
                   "', expected ascii, binary_little_endian or "
                   "binary_big_endian"));
}

// Of "property TYPE NAME" or "property list TYPE TYPE NAME".
absl::StatusOr<PlyProperty> ParsePlyProperty(const Words& words) {
  PlyProperty property;
  const bool is_list = words.size() >= 4 && words[1] == "list";
  if (is_list) {
    ISOMATCH_ASSIGN_OR_RETURN(property.count_bytes, PlyTypeBytes(words[2]));
  }
  ISOMATCH_ASSIGN_OR_RETURN(property.number_bytes,
                            PlyTypeBytes(words[is_list ? 3 : 1]));
  return property;
}

absl::Status ReadPlyLine(const Words& words, PlyHeader& header) {
  if (words[0] == "format" && words.size() >= 2) {
    ISOMATCH_ASSIGN_OR_RETURN(header.format, ParsePlyFormat(words[1]));
  } else if (words[0] == "element" && words.size() >= 3) {
    const std::string name(words[1]);
    ISOMATCH_ASSIGN_OR_RETURN(const std::int64_t count,
                              ParseCount(words[2], name));
    header.elements.push_back({name, count, {}});
  } else if (words[0] == "property" && words.size() >= 2 &&
             !header.elements.empty()) {
    ISOMATCH_ASSIGN_OR_RETURN(const PlyProperty property,
                              ParsePlyProperty(words));
    header.elements.back().properties.push_back(property);
  }
  return absl::OkStatus();
}

// Takes the header off the front of `bytes`.
absl::StatusOr<PlyHeader> ReadPlyHeader(absl::string_view& bytes) {
  PlyHeader header;
  while (!bytes.empty()) {
    const std::size_t end = std::min(bytes.find('\n'), bytes.size() - 1);
    const Words words = SplitWords(bytes.substr(0, end));
    bytes.remove_prefix(end + 1);
    if (words.empty()) continue;
    if (words[0] == "end_header") return header;
    ISOMATCH_RETURN_IF_ERROR(ReadPlyLine(words, header));
  }
  return absl::InvalidArgumentError("the header has no line end_header");
}

// The numbers after a PLY header, of which only lengths of lists are looked at.
class PlyBody {
 public:
  PlyBody(absl::string_view rest, PlyFormat format)
      : rest_(rest), format_(format) {}

  // False when fewer than `count` numbers of this size are left.
  bool Skip(std::int64_t count, int number_bytes) {
    if (format_ != PlyFormat::kAscii) {
      const auto left = static_cast<std::int64_t>(rest_.size()) / number_bytes;
      if (count > left) return false;
      rest_.remove_prefix(static_cast<std::size_t>(count * number_bytes));
      return true;
    }
    double ignored = 0;
    for (; count > 0; --count) {
      if (!absl::SimpleAtod(TakeWord(), &ignored)) return false;
    }
    return true;
  }

  // Nothing where a length should be.
  std::optional<std::int64_t> TakeLength(int number_bytes) {
    std::int64_t length = 0;
    if (format_ == PlyFormat::kAscii) {
      if (!absl::SimpleAtoi(TakeWord(), &length)) return std::nullopt;
      return length;
    }
    const auto size = static_cast<std::size_t>(number_bytes);
    if (rest_.size() < size || size > sizeof(std::uint32_t)) {
      return std::nullopt;
    }
    for (std::size_t i = 0; i < size; ++i) {
      const bool is_little = format_ == PlyFormat::kLittleEndian;
      const char byte = rest_[is_little ? size - 1 - i : i];
      length = length << 8 | static_cast<unsigned char>(byte);
    }
    rest_.remove_prefix(size);
    return length;
  }

 private:
  absl::string_view TakeWord() {
    rest_ = absl::StripLeadingAsciiWhitespace(rest_);
    const std::size_t end =
        std::min(rest_.find_first_of(" \t\r\n"), rest_.size());
    const absl::string_view word = rest_.substr(0, end);
    rest_.remove_prefix(end);
    return word;
  }

  absl::string_view rest_;
  PlyFormat format_;
};

bool SkipPlyProperty(const PlyProperty& property, PlyBody& body) {
  std::int64_t count = 1;
  if (property.count_bytes > 0) {
    const auto length = body.TakeLength(property.count_bytes);
    if (!length || *length < 0) return false;
    count = *length;
  }
  return body.Skip(count, property.number_bytes);
}

absl::Status SkipPlyElement(const PlyElement& element, PlyBody& body) {
  // Of nothing there can be any number, and a reader would count to it.
  if (element.properties.empty() && element.count > 0) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the header's element ", element.name, " has no properties"));
  }
  for (std::int64_t item = 0; item < element.count; ++item) {
    for (const PlyProperty& property : element.properties) {
      if (SkipPlyProperty(property, body)) continue;
      return absl::InvalidArgumentError(absl::StrCat(
          "the header claims ", element.count, " of element ", element.name,
          ", but the file ends, or has a wrong number or length of a list, "
          "in item ",
          item, " (0-based)"));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckOffClaims(absl::string_view bytes) {
  const Words words = OffWords(bytes);
  if (words.empty() || !absl::EndsWith(words[0], "OFF")) {
    return absl::InvalidArgumentError(
        "expected the letters OFF at its beginning");
  }
  if (words.size() < 3 || words[1] == "BINARY") {
    return absl::InvalidArgumentError(
        "expected text with the numbers of vertices and faces after OFF");
  }
  ISOMATCH_ASSIGN_OR_RETURN(const std::int64_t vertices,
                            ParseCount(words[1], "vertices"));
  ISOMATCH_ASSIGN_OR_RETURN(const std::int64_t faces,
                            ParseCount(words[2], "faces"));
  return CheckFits(absl::StrCat(vertices, " vertices and ", faces, " faces"),
                   vertices * kOffVertexBytes + faces * kOffFaceBytes,
                   static_cast<std::int64_t>(bytes.size()));
}

absl::Status CheckPlyClaims(absl::string_view bytes) {
  if (!absl::StartsWith(bytes, "ply")) {
    return absl::InvalidArgumentError(
        "expected the letters ply at its beginning");
  }
  ISOMATCH_ASSIGN_OR_RETURN(const PlyHeader header, ReadPlyHeader(bytes));
  PlyBody body(bytes, header.format);
  for (const PlyElement& element : header.elements) {
    ISOMATCH_RETURN_IF_ERROR(SkipPlyElement(element, body));
  }
  return absl::OkStatus();
}

}  // namespace isomatch
