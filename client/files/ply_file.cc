#include "client/files/ply_file.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "client/files/text_file.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

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

// Of "property TYPE NAME" or "property list TYPE TYPE NAME".
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

absl::Status ReadLine(const Words& words, PlyHeader& header) {
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

// The bytes of a value, as binary_little_endian has them on the machines we
// build for.
template <typename T>
void AppendBytes(std::string* bytes, T value) {
  bytes->append(reinterpret_cast<const char*>(&value), sizeof(value));
}

const char* TypeName(PlyColumn::Type type) {
  switch (type) {
    case PlyColumn::Type::kFloat:
      return "float";
    case PlyColumn::Type::kInt:
      return "int";
    case PlyColumn::Type::kUchar:
      return "uchar";
  }
  return "";  // not reached
}

void AppendValue(std::string* bytes, const PlyColumn& column, VertexIndex v) {
  const double value = column.value(v);
  switch (column.type) {
    case PlyColumn::Type::kFloat:
      return AppendBytes(bytes, static_cast<float>(value));
    case PlyColumn::Type::kInt:
      return AppendBytes(bytes, static_cast<std::int32_t>(value));
    case PlyColumn::Type::kUchar:
      return AppendBytes(bytes, static_cast<std::uint8_t>(value));
  }
}

}  // namespace

absl::StatusOr<PlyHeader> TakePlyHeader(absl::string_view& bytes) {
  PlyHeader header;
  while (!bytes.empty()) {
    const std::size_t end = std::min(bytes.find('\n'), bytes.size() - 1);
    const Words words = SplitWords(bytes.substr(0, end));
    bytes.remove_prefix(end + 1);
    if (words.empty()) continue;
    if (words[0] == "end_header") return header;
    ISOMATCH_RETURN_IF_ERROR(ReadLine(words, header));
  }
  return absl::InvalidArgumentError("the header has no line end_header");
}

bool PlyBody::Skip(std::int64_t count, const PlyType& type) {
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

std::optional<std::int64_t> PlyBody::TakeLength(const PlyType& type) {
  if (format_ == PlyFormat::kAscii) {
    std::int64_t length = 0;
    if (!absl::SimpleAtoi(TakeWord(), &length)) return std::nullopt;
    return length;
  }
  constexpr int kMaxLengthBytes = 4;
  if (type.bytes > kMaxLengthBytes) return std::nullopt;
  return TakeBytes(type.bytes);
}

std::optional<double> PlyBody::TakeNumber(const PlyType& type) {
  if (format_ == PlyFormat::kAscii) {
    double number = 0;
    if (!absl::SimpleAtod(TakeWord(), &number)) return std::nullopt;
    return number;
  }
  const std::optional<std::uint64_t> bits = TakeBytes(type.bytes);
  if (!bits) return std::nullopt;
  return FromBits(*bits, type);
}

absl::string_view PlyBody::TakeWord() {
  rest_ = absl::StripLeadingAsciiWhitespace(rest_);
  const std::size_t end =
      std::min(rest_.find_first_of(" \t\r\n"), rest_.size());
  const absl::string_view word = rest_.substr(0, end);
  rest_.remove_prefix(end);
  return word;
}

std::optional<std::uint64_t> PlyBody::TakeBytes(int count) {
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

std::string FormatPly(const TriangleMesh& mesh,
                      absl::Span<const PlyColumn> columns) {
  std::string bytes =
      absl::StrCat("ply\nformat binary_little_endian 1.0\nelement vertex ",
                   mesh.num_vertices(),
                   "\nproperty float x\nproperty float y\nproperty float z\n");
  for (const PlyColumn& column : columns) {
    absl::StrAppend(&bytes, "property ", TypeName(column.type), " ",
                    column.name, "\n");
  }
  absl::StrAppend(&bytes, "element face ", mesh.num_faces(),
                  "\nproperty list uchar int vertex_indices\nend_header\n");
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      AppendBytes(&bytes, static_cast<float>(mesh.positions(v, axis)));
    }
    for (const PlyColumn& column : columns) AppendValue(&bytes, column, v);
  }
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    AppendBytes(&bytes, std::uint8_t{3});
    for (int i = 0; i < 3; ++i) AppendBytes(&bytes, mesh.faces(f, i));
  }
  return bytes;
}

}  // namespace isomatch
