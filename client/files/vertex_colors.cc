#include "client/files/vertex_colors.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "client/files/obj_reader.h"
#include "client/files/text_file.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

using Words = std::vector<absl::string_view>;

constexpr double kByteScale = 255;
constexpr char kWhat[] = "a mesh";

// Largest value of an unsigned type, 1 of a fraction.
double ScaleOf(const PlyType& type) {
  if (type.kind == PlyType::Kind::kFloat) return 1;
  return std::ldexp(1.0, 8 * type.bytes) - 1;
}

// Which column of a color a property of a PLY file's vertices is; -1 for none.
int ChannelOf(const std::string& name) {
  constexpr std::array<const char*, 3> kNames = {"red", "green", "blue"};
  for (int channel = 0; channel < 3; ++channel) {
    const char* known = kNames[static_cast<std::size_t>(channel)];
    if (name == known || name == absl::StrCat("diffuse_", known)) {
      return channel;
    }
  }
  return -1;
}

bool HasAllChannels(const PlyElement& element) {
  std::array<bool, 3> has = {};
  for (const PlyProperty& property : element.properties) {
    const int channel = ChannelOf(property.name);
    if (channel >= 0 && !property.count_type) {
      has[static_cast<std::size_t>(channel)] = true;
    }
  }
  return has[0] && has[1] && has[2];
}

// Takes one item of an element; what is a color goes to `color`, unless null.
bool TakeItem(const PlyElement& element, PlyBody& body,
              Eigen::RowVector3d* color) {
  for (const PlyProperty& property : element.properties) {
    std::int64_t count = 1;
    if (property.count_type) {
      const auto length = body.TakeLength(*property.count_type);
      if (!length || *length < 0) return false;
      count = *length;
    }
    const int channel = ChannelOf(property.name);
    if (color == nullptr || channel < 0 || property.count_type) {
      if (!body.Skip(count, property.type)) return false;
      continue;
    }
    const std::optional<double> number = body.TakeNumber(property.type);
    if (!number || !std::isfinite(*number)) return false;
    (*color)[channel] = *number / ScaleOf(property.type);
  }
  return true;
}

absl::StatusOr<std::optional<Colors>> FromPly(const std::string& path,
                                              absl::string_view bytes,
                                              VertexIndex vertices) {
  ISOMATCH_ASSIGN_OR_RETURN(const PlyHeader header, TakePlyHeader(bytes));
  PlyBody body(bytes, header.format);
  for (const PlyElement& element : header.elements) {
    const bool is_vertex = element.name == "vertex";
    if (is_vertex && !HasAllChannels(element)) return std::nullopt;
    Colors colors = Colors::Zero(is_vertex ? vertices : 0, 3);
    for (std::int64_t item = 0; item < element.count; ++item) {
      Eigen::RowVector3d color = kNoColor;
      if (!TakeItem(element, body, is_vertex ? &color : nullptr)) {
        return absl::InvalidArgumentError(
            absl::StrCat("'", path, "': item ", item, " (0-based) of element ",
                         element.name, " has no number where one should be"));
      }
      if (is_vertex && item < vertices) colors.row(item) = color;
    }
    if (is_vertex) return colors;
  }
  return std::nullopt;
}

// Colors as they are read from lines, before their unit is known.
struct RawColors {
  std::vector<Eigen::RowVector3d> rows;
  VertexIndex without = 0;
  bool has_fractions = false;
};

// Takes three numbers from words[first] on; without them the vertex has none.
absl::Status AddColor(const std::string& path, int line, const Words& words,
                      std::size_t first, RawColors& raw) {
  Eigen::RowVector3d color = Eigen::RowVector3d::Zero();
  if (words.size() < first + 3) {
    ++raw.without;
    raw.rows.push_back(color);
    return absl::OkStatus();
  }
  for (int channel = 0; channel < 3; ++channel) {
    const absl::string_view word =
        words[first + static_cast<std::size_t>(channel)];
    if (!absl::SimpleAtod(word, &color[channel]) || !(color[channel] >= 0) ||
        !std::isfinite(color[channel])) {
      return LineError(path, line,
                       absl::StrCat("a vertex's color is '", word.substr(0, 40),
                                    "', expected a number of 0 or more"));
    }
    raw.has_fractions |= word.find_first_of(".eE") != absl::string_view::npos;
  }
  raw.rows.push_back(color);
  return absl::OkStatus();
}

absl::StatusOr<std::optional<Colors>> Scaled(const std::string& path,
                                             const RawColors& raw,
                                             VertexIndex vertices,
                                             double scale) {
  const auto rows = static_cast<VertexIndex>(raw.rows.size());
  // Coordinates that are spread over lines otherwise have no colors.
  if (raw.without == rows || rows != vertices) return std::nullopt;
  if (raw.without > 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", path, "': ", raw.without, " of ", rows,
                     " vertices have no color, expected all or none"));
  }
  Colors colors(rows, 3);
  for (VertexIndex v = 0; v < rows; ++v) {
    colors.row(v) = raw.rows[static_cast<std::size_t>(v)] / scale;
  }
  return colors;
}

absl::StatusOr<std::optional<Colors>> FromObj(const std::string& path,
                                              absl::string_view text,
                                              VertexIndex vertices) {
  RawColors raw;
  double largest = 0;
  const auto read = [&](int line, absl::string_view statement) {
    if (statement[0] != 'v') return absl::OkStatus();
    const Words words = SplitWords(statement);
    if (words[0] != "v") return absl::OkStatus();
    constexpr std::size_t kFirst = 4;
    const absl::Status status = AddColor(path, line, words, kFirst, raw);
    if (status.ok()) largest = std::max(largest, raw.rows.back().maxCoeff());
    return status;
  };
  ISOMATCH_RETURN_IF_ERROR(ForEachObjStatement(text, read));
  return Scaled(path, raw, vertices, largest > 1 ? kByteScale : 1);
}

absl::StatusOr<std::optional<Colors>> FromOff(const std::string& path,
                                              absl::string_view text,
                                              VertexIndex vertices) {
  RawColors raw;
  int line = 0;
  std::size_t header_words = 0;
  std::size_t first = 3;
  for (absl::string_view row : absl::StrSplit(text, '\n')) {
    ++line;
    const Words words = SplitWords(row.substr(0, row.find('#')));
    if (words.empty()) continue;
    constexpr std::size_t kHeaderWords = 4;
    if (header_words < kHeaderWords) {
      // OFF, vertices, faces, edges; NOFF has normals before colors.
      if (header_words == 0 && absl::StrContains(words[0], "N")) first += 3;
      header_words += words.size();
      continue;
    }
    if (raw.rows.size() >= static_cast<std::size_t>(vertices)) break;
    ISOMATCH_RETURN_IF_ERROR(AddColor(path, line, words, first, raw));
  }
  return Scaled(path, raw, vertices, raw.has_fractions ? 1 : kByteScale);
}

}  // namespace

Colors PositionColors(const Positions& positions) {
  const std::vector<Rgb> bytes = PlaceColors(positions);
  Colors colors(positions.rows(), 3);
  for (std::size_t v = 0; v < bytes.size(); ++v) {
    for (std::size_t channel = 0; channel < 3; ++channel) {
      colors(static_cast<Eigen::Index>(v), static_cast<Eigen::Index>(channel)) =
          bytes[v][channel] / kByteScale;
    }
  }
  return colors;
}

absl::StatusOr<std::optional<Colors>> ReadVertexColors(const std::string& path,
                                                       VertexIndex vertices) {
  const std::string extension = LowerExtension(path);
  if (extension == ".stl") return std::nullopt;
  ISOMATCH_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path, kWhat));
  if (extension == ".ply") return FromPly(path, bytes, vertices);
  if (extension == ".off") return FromOff(path, bytes, vertices);
  return FromObj(path, bytes, vertices);
}

Rgb ColorBytes(const Eigen::RowVector3d& color) {
  Rgb bytes;
  for (std::size_t channel = 0; channel < 3; ++channel) {
    const double value = color[static_cast<Eigen::Index>(channel)];
    bytes[channel] = static_cast<std::uint8_t>(
        std::lround(kByteScale * std::clamp(value, 0.0, 1.0)));
  }
  return bytes;
}

std::vector<PlyColumn> ColorColumns(const Colors& colors) {
  std::vector<PlyColumn> columns;
  for (const auto& [name, channel] :
       {std::pair("red", 0u), std::pair("green", 1u), std::pair("blue", 2u)}) {
    columns.push_back({name, PlyColumn::Type::kUchar,
                       [&colors, channel = channel](VertexIndex v) {
                         return ColorBytes(colors.row(v))[channel];
                       }});
  }
  return columns;
}

}  // namespace isomatch
