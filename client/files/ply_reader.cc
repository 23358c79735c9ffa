#include "client/files/ply_reader.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "client/files/text_file.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

// How the numbers after a PLY header are written.
enum class PlyFormat { kAscii, kLittleEndian, kBigEndian };

// A number's type in a PLY file.
struct PlyType {
  enum class Kind { kSigned, kUnsigned, kFloat };
  int bytes = 0;
  Kind kind = Kind::kSigned;
};

// What each item of an element has under one name: a number, or a list of
// numbers that begins with their count.
struct PlyProperty {
  std::string name;
  PlyType type;
  // Not set for a single number.
  std::optional<PlyType> count_type;
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

using Words = std::vector<absl::string_view>;
using Kind = PlyType::Kind;

absl::StatusOr<PlyType> ParseType(absl::string_view name) {
  static constexpr std::array<std::pair<absl::string_view, PlyType>, 16>
      kTypes = {{
          {"char", {1, Kind::kSigned}},
          {"int8", {1, Kind::kSigned}},
          {"uchar", {1, Kind::kUnsigned}},
          {"uint8", {1, Kind::kUnsigned}},
          {"short", {2, Kind::kSigned}},
          {"int16", {2, Kind::kSigned}},
          {"ushort", {2, Kind::kUnsigned}},
          {"uint16", {2, Kind::kUnsigned}},
          {"int", {4, Kind::kSigned}},
          {"int32", {4, Kind::kSigned}},
          {"uint", {4, Kind::kUnsigned}},
          {"uint32", {4, Kind::kUnsigned}},
          {"float", {4, Kind::kFloat}},
          {"float32", {4, Kind::kFloat}},
          {"double", {8, Kind::kFloat}},
          {"float64", {8, Kind::kFloat}},
      }};
  for (const auto& [known, type] : kTypes) {
    if (name == known) return type;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("the header's type ", Quoted(name),
                   " is unknown, expected e.g. float or int"));
}

absl::StatusOr<PlyFormat> ParseFormat(absl::string_view word) {
  if (word == "ascii") return PlyFormat::kAscii;
  if (word == "binary_little_endian") return PlyFormat::kLittleEndian;
  if (word == "binary_big_endian") return PlyFormat::kBigEndian;
  return absl::InvalidArgumentError(
      absl::StrCat("the header's format is ", Quoted(word),
                   ", expected ascii, binary_little_endian or "
                   "binary_big_endian"));
}

// Parses "property TYPE NAME" or "property list TYPE TYPE NAME".
absl::StatusOr<PlyProperty> ParseProperty(const Words& words) {
  PlyProperty property;
  const bool is_list = words.size() >= 4 && words[1] == "list";
  if (is_list) {
    ISOMATCH_ASSIGN_OR_RETURN(property.count_type, ParseType(words[2]));
  }
  ISOMATCH_ASSIGN_OR_RETURN(property.type, ParseType(words[is_list ? 3 : 1]));
  property.name = std::string(words.back());
  return property;
}

absl::Status ReadHeaderLine(const Words& words, PlyHeader& header) {
  if (words[0] == "format" && words.size() >= 2) {
    ISOMATCH_ASSIGN_OR_RETURN(header.format, ParseFormat(words[1]));
  } else if (words[0] == "element" && words.size() >= 3) {
    const std::string name(words[1]);
    ISOMATCH_ASSIGN_OR_RETURN(const std::int64_t count,
                              ParseHeaderCount(words[2], name));
    header.elements.push_back({name, count, {}});
  } else if (words[0] == "property" && words.size() >= 2 &&
             !header.elements.empty()) {
    ISOMATCH_ASSIGN_OR_RETURN(PlyProperty property, ParseProperty(words));
    header.elements.back().properties.push_back(std::move(property));
  }
  return absl::OkStatus();
}

// Takes the header off the front of the bytes of a PLY file.
absl::StatusOr<PlyHeader> TakePlyHeader(absl::string_view& bytes) {
  PlyHeader header;
  while (!bytes.empty()) {
    const std::size_t end = std::min(bytes.find('\n'), bytes.size() - 1);
    const Words words = SplitWords(bytes.substr(0, end));
    bytes.remove_prefix(end + 1);
    if (words.empty()) continue;
    if (words[0] == "end_header") return header;
    ISOMATCH_RETURN_IF_ERROR(ReadHeaderLine(words, header));
  }
  return absl::InvalidArgumentError("the header has no line end_header");
}

double FromBits(std::uint64_t bits, const PlyType& type) {
  switch (type.kind) {
    case Kind::kFloat:
      return type.bytes == 4
                 ? std::bit_cast<float>(static_cast<std::uint32_t>(bits))
                 : std::bit_cast<double>(bits);
    case Kind::kUnsigned:
      return static_cast<double>(bits);
    case Kind::kSigned: {
      const int unused_bits = 64 - 8 * type.bytes;
      return static_cast<double>(
          static_cast<std::int64_t>(bits << unused_bits) >> unused_bits);
    }
  }
  return 0;  // not reached
}

// The numbers after a PLY header, in order.
class PlyBody {
 public:
  PlyBody(absl::string_view rest, PlyFormat format)
      : rest_(rest), format_(format) {}

  // False when fewer than `count` numbers of this type are left.
  bool Skip(std::int64_t count, const PlyType& type) {
    if (format_ != PlyFormat::kAscii) {
      const auto left = static_cast<std::int64_t>(rest_.size()) / type.bytes;
      if (count > left) return false;
      rest_.remove_prefix(static_cast<std::size_t>(count * type.bytes));
      return true;
    }
    for (; count > 0; --count) {
      if (!TakeNumber(type)) return false;
    }
    return true;
  }

  // Nothing where a length should be.
  std::optional<std::int64_t> TakeLength(const PlyType& type) {
    if (format_ == PlyFormat::kAscii) {
      std::int64_t length = 0;
      if (!absl::SimpleAtoi(TakeWord(), &length)) return std::nullopt;
      return length;
    }
    constexpr int kMaxLengthBytes = 4;
    if (type.bytes > kMaxLengthBytes) return std::nullopt;
    return TakeBytes(type.bytes);
  }

  // Nothing where a number should be. Exact for all but 8-byte integers, which
  // PLY does not have.
  std::optional<double> TakeNumber(const PlyType& type) {
    if (format_ == PlyFormat::kAscii) {
      double number = 0;
      if (!absl::SimpleAtod(TakeWord(), &number)) return std::nullopt;
      return number;
    }
    const std::optional<std::uint64_t> bits = TakeBytes(type.bytes);
    if (!bits) return std::nullopt;
    return FromBits(*bits, type);
  }

  // What was not taken yet.
  absl::string_view rest() const { return rest_; }

 private:
  absl::string_view TakeWord() {
    rest_ = absl::StripLeadingAsciiWhitespace(rest_);
    const std::size_t end =
        std::min(rest_.find_first_of(" \t\r\n"), rest_.size());
    const absl::string_view word = rest_.substr(0, end);
    rest_.remove_prefix(end);
    return word;
  }

  std::optional<std::uint64_t> TakeBytes(int count) {
    const auto size = static_cast<std::size_t>(count);
    if (rest_.size() < size) return std::nullopt;
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < size; ++i) {
      const bool is_little = format_ == PlyFormat::kLittleEndian;
      const char byte = rest_[is_little ? size - 1 - i : i];
      value = value << 8 | static_cast<unsigned char>(byte);
    }
    rest_.remove_prefix(size);
    return value;
  }

  absl::string_view rest_;
  PlyFormat format_;
};

// By PlyFormat.
constexpr std::array<const char*, 3> kFormatNames = {
    "PLY, ascii", "PLY, binary little endian", "PLY, binary big endian"};

// What is read of a vertex: the coordinates, then the color.
constexpr std::array<absl::string_view, 6> kColumns = {"x",   "y",     "z",
                                                       "red", "green", "blue"};
constexpr std::size_t kFirstChannel = 3;

// Which of kColumns a property is; nothing for none.
std::optional<std::size_t> ColumnOf(const PlyElement& element,
                                    const PlyProperty& property) {
  if (element.name != "vertex" || property.count_type) return std::nullopt;
  for (std::size_t column = 0; column < kColumns.size(); ++column) {
    if (property.name == kColumns[column] ||
        (column >= kFirstChannel &&
         property.name == absl::StrCat("diffuse_", kColumns[column]))) {
      return column;
    }
  }
  return std::nullopt;
}

bool IsFace(const PlyElement& element, const PlyProperty& property) {
  return element.name == "face" && property.count_type &&
         (property.name == "vertex_indices" || property.name == "vertex_index");
}

// What stands for 1 in a color.
double UnitOf(const PlyType& type) {
  if (type.kind == Kind::kFloat) return 1;
  return std::ldexp(1.0, 8 * type.bytes) - 1;
}

// Reads what follows the header of a PLY file.
class PlyReader {
 public:
  PlyReader(const PlyHeader& header, absl::string_view bytes,
            absl::string_view rest, PolygonSoup* soup)
      : header_(header),
        bytes_(bytes),
        body_(rest, header.format),
        soup_(soup) {
    soup->format = kFormatNames[static_cast<std::size_t>(header.format)];
    for (const PlyElement& element : header.elements) {
      if (element.name == "vertex") {
        vertices_ = element.count;
        ++vertex_elements_;
      }
      for (const PlyProperty& property : element.properties) {
        if (const auto column = ColumnOf(element, property)) ++has_[*column];
        has_faces_ |= IsFace(element, property);
      }
    }
    has_colors_ = std::count(has_.begin() + kFirstChannel, has_.end(), 0) == 0;
  }

  std::optional<MeshFault> Read() {
    for (const PlyElement& element : header_.elements) {
      // Items without properties take no bytes: a small file may announce any
      // number of them, and reading would count up to it.
      if (element.properties.empty() && element.count > 0) {
        return MeshFault{"", absl::StrCat("the header's element ", element.name,
                                          " has no properties")};
      }
      if (!ReadElement(element)) return fault_;
    }
    // Each coordinate once.
    if (std::count(has_.begin(), has_.begin() + kFirstChannel, 1) == 3 &&
        vertex_elements_ == 1 && has_faces_) {
      return std::nullopt;
    }
    return MeshFault{"",
                     "expected one element vertex with x, y, z and element "
                     "face with list vertex_indices"};
  }

 private:
  // Room for what the header claims, as far as the file's size bears it.
  void Reserve(const PlyElement& element) {
    const std::size_t item_bytes = 1 + 2 * element.properties.size();
    const std::size_t most = std::min(static_cast<std::size_t>(element.count),
                                      body_.rest().size() / item_bytes);
    if (element.name == "vertex") soup_->points.reserve(most);
    if (element.name != "face") return;
    soup_->sizes.reserve(most);
    soup_->corners.reserve(3 * most);
  }

  // Each of these returns false after a fault.
  bool ReadElement(const PlyElement& element) {
    std::vector<std::optional<std::size_t>> columns;
    for (const PlyProperty& property : element.properties) {
      columns.push_back(ColumnOf(element, property));
    }
    Reserve(element);
    for (item_ = 0; item_ < element.count; ++item_) {
      for (std::size_t i = 0; i < columns.size(); ++i) {
        const PlyProperty& property = element.properties[i];
        const bool is_read = property.count_type
                                 ? ReadList(element, property)
                                 : ReadValue(element, property, columns[i]);
        if (!is_read) return false;
      }
      if (element.name != "vertex") continue;
      soup_->points.push_back({vertex_[0], vertex_[1], vertex_[2]});
      if (!has_colors_) continue;
      soup_->colors.push_back({vertex_[3], vertex_[4], vertex_[5]});
    }
    return true;
  }

  bool ReadValue(const PlyElement& element, const PlyProperty& property,
                 std::optional<std::size_t> column) {
    if (!column && header_.format != PlyFormat::kAscii) {
      return body_.Skip(1, property.type) || FailAtEnd(element);
    }
    const std::optional<double> number = body_.TakeNumber(property.type);
    if (!number) return FailAtNumber(element, "a number");
    if (!column) return true;
    const bool is_color = *column >= kFirstChannel;
    vertex_[*column] = is_color ? *number / UnitOf(property.type) : *number;
    // The polygons are good without colors; the first fault is told.
    const bool is_ignored = is_color && (!has_colors_ || soup_->color_fault);
    if (std::isfinite(*number) || is_ignored) return true;
    Fail(absl::StrCat(property.name, " of vertex ", item_, " (0-based) is ",
                      *number, ", expected a finite number"));
    if (is_color) soup_->color_fault = fault_;
    return is_color;
  }

  bool ReadList(const PlyElement& element, const PlyProperty& property) {
    const std::optional<std::int64_t> length =
        body_.TakeLength(*property.count_type);
    if (!length) return FailAtNumber(element, "the length of a list");
    // In text a number takes two bytes with its blank, but for the last one.
    const std::int64_t bytes =
        header_.format == PlyFormat::kAscii ? 2 : property.type.bytes;
    const auto left = static_cast<std::int64_t>(body_.rest().size());
    if (*length < 0 || *length > (left + 1) / bytes) {
      return Fail(absl::StrCat("the header claims ", element.count,
                               " of element ", element.name,
                               ", but the file ends in item ", item_,
                               " (0-based): the length of its list is ",
                               *length, ", and ", left, " bytes are left"));
    }
    if (!IsFace(element, property)) {
      return body_.Skip(*length, property.type) ||
             FailAtNumber(element, "a number");
    }
    if (*length < 3) {
      return Fail(absl::StrCat("face ", item_, " (0-based) has ", *length,
                               " corners, expected 3 or more"));
    }
    return ReadCorners(element, property, *length);
  }

  bool ReadCorners(const PlyElement& element, const PlyProperty& property,
                   std::int64_t corners) {
    for (std::int64_t corner = 0; corner < corners; ++corner) {
      const std::optional<double> vertex = body_.TakeNumber(property.type);
      if (!vertex) return FailAtNumber(element, "a number of a vertex");
      if (0 <= *vertex && *vertex < static_cast<double>(vertices_) &&
          *vertex == std::floor(*vertex)) {
        soup_->corners.push_back(static_cast<VertexIndex>(*vertex));
        continue;
      }
      return Fail(absl::StrCat("face ", item_, " (0-based) names vertex ",
                               *vertex, ", expected 0 to ", vertices_ - 1));
    }
    soup_->sizes.push_back(static_cast<VertexIndex>(corners));
    return true;
  }

  bool FailAtNumber(const PlyElement& element, const char* expected) {
    constexpr absl::string_view kBlanks = " \t\r\n";
    const bool ends =
        header_.format != PlyFormat::kAscii ||
        body_.rest().find_first_not_of(kBlanks) == absl::string_view::npos;
    if (ends) return FailAtEnd(element);
    return Fail(absl::StrCat("item ", item_, " (0-based) of ", element.name,
                             " has no number where ", expected,
                             " is expected"));
  }

  bool FailAtEnd(const PlyElement& element) {
    return Fail(absl::StrCat(
        "the header claims ", element.count, " of element ", element.name,
        ", but the file ends in item ", item_, " (0-based)"));
  }

  bool Fail(std::string what) {
    fault_ = {"", std::move(what)};
    if (header_.format == PlyFormat::kAscii) {
      const absl::string_view taken =
          bytes_.substr(0, bytes_.size() - body_.rest().size());
      fault_.where = absl::StrCat(
          "line ", 1 + std::count(taken.begin(), taken.end(), '\n'));
    }
    return false;
  }

  const PlyHeader& header_;
  const absl::string_view bytes_;
  PlyBody body_;
  PolygonSoup* const soup_;
  // How many properties are each of kColumns.
  std::array<int, kColumns.size()> has_ = {};
  bool has_faces_ = false;
  bool has_colors_ = false;
  int vertex_elements_ = 0;
  std::array<double, kColumns.size()> vertex_ = {};
  std::int64_t vertices_ = 0;
  std::int64_t item_ = 0;
  MeshFault fault_;
};

}  // namespace

std::optional<MeshFault> ReadPlySoup(absl::string_view bytes,
                                     PolygonSoup* soup) {
  if (!absl::StartsWith(bytes, "ply")) {
    return MeshFault{"", "expected the letters ply at its beginning"};
  }
  absl::string_view rest = bytes;
  const absl::StatusOr<PlyHeader> header = TakePlyHeader(rest);
  if (!header.ok()) {
    return MeshFault{"", std::string(header.status().message())};
  }
  return PlyReader(*header, bytes, rest, soup).Read();
}

}  // namespace isomatch
