#include "client/files/map_file.h"

#include <cassert>
#include <cstddef>
#include <limits>
#include <unordered_map>
#include <utility>

#include <nlohmann/json.hpp>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "client/files/input_file.h"
#include "client/files/json_limits.h"
#include "client/files/map_parser.h"
#include "client/files/npy_file.h"
#include "client/files/text_file.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

using Json = nlohmann::ordered_json;

constexpr char kJsonFormat[] = "isomatch-map";
constexpr int kJsonVersion = 1;
constexpr char kMapLines[] = "a map: one vertex index of Y a line";
constexpr absl::string_view kNpyMagic = "\x93NUMPY";

absl::StatusOr<std::vector<NumberLine>> NumberLines(const std::string& path,
                                                    absl::string_view text,
                                                    const std::string& what) {
  ISOMATCH_ASSIGN_OR_RETURN(std::vector<NumberLine> lines,
                            ParseNumberLines(path, text));
  if (lines.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", path, "': no line of numbers, expected ", what));
  }
  return lines;
}

absl::Status CheckColumns(const std::string& path, const NumberLine& line,
                          std::size_t columns, const std::string& names) {
  if (line.numbers.size() == columns) return absl::OkStatus();
  return LineError(
      path, line.line,
      absl::StrCat("found ", line.numbers.size(), " numbers, expected ",
                   columns, " (", names, ")"));
}

// What a column of vertices is called, and its numbers, [first, end).
struct VertexColumn {
  const char* name;
  std::int64_t first;
  std::int64_t end;
};

// Checks the number in `column`, as `expected`.
absl::Status CheckVertex(const std::string& path, const NumberLine& line,
                         std::size_t column, const VertexColumn& expected) {
  const std::int64_t found = line.numbers[column];
  if (expected.first <= found && found < expected.end) return absl::OkStatus();
  return LineError(
      path, line.line,
      absl::StrCat(expected.name, " is ", found, ", expected ", expected.first,
                   " to ", expected.end - 1, " (0-based)"));
}

// The vertex that each vertex of one shape is matched to.
struct Partners {
  const char* shape;
  std::unordered_map<VertexIndex, VertexIndex> of;
};

// Remembers that `from` goes with `to`; an error when it went with another one
// before.
absl::Status CheckPartner(const std::string& path, int line, VertexIndex from,
                          VertexIndex to, Partners& partners) {
  const auto [entry, is_new] = partners.of.emplace(from, to);
  if (is_new || entry->second == to) return absl::OkStatus();
  return LineError(path, line,
                   absl::StrCat("vertex ", from, " of ", partners.shape,
                                " is matched to ", to, " and before to ",
                                entry->second, ", expected one partner"));
}

absl::StatusOr<GroundTruth> TruthFromColumn(
    const std::string& path, const std::vector<NumberLine>& lines,
    std::int64_t vertices_x, std::int64_t vertices_y) {
  if (static_cast<std::int64_t>(lines.size()) != vertices_x) {
    return absl::InvalidArgumentError(absl::StrCat(
        "'", path, "': ", lines.size(), " lines of one number, expected ",
        vertices_x, ", one for each vertex of X, or lines `x y`"));
  }
  GroundTruth truth;
  for (const NumberLine& line : lines) {
    ISOMATCH_RETURN_IF_ERROR(CheckColumns(path, line, 1, "y"));
    ISOMATCH_RETURN_IF_ERROR(
        CheckVertex(path, line, 0, {"y", kNoVertex, vertices_y}));
    truth.direct.push_back(static_cast<VertexIndex>(line.numbers[0]));
  }
  return truth;
}

absl::StatusOr<GroundTruth> TruthFromPairs(const std::string& path,
                                           const std::vector<NumberLine>& lines,
                                           std::int64_t vertices_x,
                                           std::int64_t vertices_y) {
  const std::size_t columns = lines.front().numbers.size();
  const VertexMap none(static_cast<std::size_t>(vertices_x), kNoVertex);
  GroundTruth truth{none, columns == 3 ? none : VertexMap{},
                    std::vector<bool>(none.size())};
  for (const NumberLine& line : lines) {
    ISOMATCH_RETURN_IF_ERROR(CheckColumns(
        path, line, columns, columns == 3 ? "x y y_mirrored" : "x y"));
    ISOMATCH_RETURN_IF_ERROR(CheckVertex(path, line, 0, {"x", 0, vertices_x}));
    ISOMATCH_RETURN_IF_ERROR(
        CheckVertex(path, line, 1, {"y", kNoVertex, vertices_y}));
    const auto x = static_cast<std::size_t>(line.numbers[0]);
    truth.direct[x] = static_cast<VertexIndex>(line.numbers[1]);
    truth.named[x] = true;
    if (columns < 3) continue;
    ISOMATCH_RETURN_IF_ERROR(
        CheckVertex(path, line, 2, {"y_mirrored", kNoVertex, vertices_y}));
    truth.mirrored[x] = static_cast<VertexIndex>(line.numbers[2]);
  }
  return truth;
}

// Numbers of a file, one for each vertex.
struct Entries {
  std::vector<std::int64_t> values;
  // Where each stands in a text file; empty for the other formats.
  std::vector<int> lines;

  std::string Where(const std::string& path, std::size_t i) const {
    return lines.empty() ? absl::StrCat("'", path, "', entry ", i, " (0-based)")
                         : absl::StrCat("'", path, "', line ", lines[i]);
  }
};

absl::StatusOr<Entries> EntriesFromText(const std::string& path,
                                        absl::string_view text,
                                        const std::string& name,
                                        const std::string& what) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::vector<NumberLine> lines,
                            NumberLines(path, text, what));
  Entries entries;
  for (const NumberLine& line : lines) {
    ISOMATCH_RETURN_IF_ERROR(CheckColumns(path, line, 1, name));
    entries.values.push_back(line.numbers[0]);
    entries.lines.push_back(line.line);
  }
  return entries;
}

absl::StatusOr<Entries> EntriesFromNpy(const std::string& path,
                                       absl::string_view bytes) {
  Entries entries;
  ISOMATCH_ASSIGN_OR_RETURN(entries.values, ParseNpy(path, bytes));
  return entries;
}

absl::Status JsonError(const std::string& path, const std::string& what) {
  return absl::InvalidArgumentError(absl::StrCat("'", path, "': ", what));
}

absl::Status ParseJson(const std::string& path, absl::string_view text,
                       Json* json) {
  // A map has one object, an array and as many numbers as the text holds.
  const JsonLimits limits = {.depth = 8,
                             .values = std::numeric_limits<std::int64_t>::max(),
                             .objects = 1000};
  if (const auto fault = CheckJsonText(text, limits)) {
    return JsonError(
        path,
        absl::StrCat(
            fault->byte ? absl::StrCat("byte ", *fault->byte, ": ") : "",
            fault->what, ", expected a map as `isomatch match` writes it"));
  }
  *json = Json::parse(text, /*cb=*/nullptr, /*allow_exceptions=*/false);
  return absl::OkStatus();
}

// For errors: a number or a word as it stands, cut; of others, which may be
// large, only what they are.
std::string Shown(const Json& json) {
  if (!json.is_primitive()) return json.type_name();
  return json.dump(-1, ' ', false, Json::error_handler_t::replace)
      .substr(0, 40);
}

// Checks json[key], a number that the file must agree on.
absl::Status CheckJsonNumber(const std::string& path, const Json& json,
                             const char* key, std::int64_t expected) {
  const auto found = json.find(key);
  if (found != json.end() && *found == expected) return absl::OkStatus();
  return JsonError(
      path,
      absl::StrCat(key, " is ", found == json.end() ? "missing" : Shown(*found),
                   ", expected ", expected));
}

absl::StatusOr<Entries> EntriesFromJson(const std::string& path,
                                        absl::string_view text,
                                        std::int64_t vertices_y) {
  Json json;
  ISOMATCH_RETURN_IF_ERROR(ParseJson(path, text, &json));
  const auto format = json.find("format");
  if (format == json.end() || *format != kJsonFormat) {
    return JsonError(path, absl::StrCat("expected a JSON object with format \"",
                                        kJsonFormat, "\""));
  }
  ISOMATCH_RETURN_IF_ERROR(
      CheckJsonNumber(path, json, "version", kJsonVersion));
  ISOMATCH_RETURN_IF_ERROR(
      CheckJsonNumber(path, json, "vertices_y", vertices_y));
  const auto array = json.find("y_from_x");
  if (array == json.end() || !array->is_array()) {
    return JsonError(path, "y_from_x is no array, expected one");
  }
  ISOMATCH_RETURN_IF_ERROR(CheckJsonNumber(
      path, json, "vertices_x", static_cast<std::int64_t>(array->size())));
  constexpr std::uint64_t kLargest = std::numeric_limits<std::int64_t>::max();
  Entries entries;
  for (const Json& entry : *array) {
    const bool is_whole = entry.is_number_unsigned()
                              ? entry.get<std::uint64_t>() <= kLargest
                              : entry.is_number_integer();
    if (!is_whole) {
      return JsonError(path,
                       absl::StrCat("y_from_x[", entries.values.size(), "] is ",
                                    Shown(entry), ", expected a whole number"));
    }
    entries.values.push_back(entry.get<std::int64_t>());
  }
  return entries;
}

MapFormat FormatOfExtension(absl::string_view extension) {
  if (extension == ".npy") return MapFormat::kNpy;
  if (extension == ".json") return MapFormat::kJson;
  if (extension == ".ply") return MapFormat::kPly;
  return MapFormat::kText;
}

absl::StatusOr<Entries> MapEntries(const std::string& path,
                                   const InputFile& file,
                                   std::int64_t vertices_y) {
  switch (MapFormatOf(path, file)) {
    case MapFormat::kText:
      return EntriesFromText(path, file.bytes, "y", kMapLines);
    case MapFormat::kNpy:
      return EntriesFromNpy(path, file.bytes);
    case MapFormat::kJson:
      return EntriesFromJson(path, file.bytes, vertices_y);
    case MapFormat::kPly:
      break;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("'", path,
                   "': a map in a .ply file is for looking at only, expected "
                   "one in a .txt, .npy or .json file"));
}

// Checks that there is one entry for each of `expected` vertices of `name`.
absl::Status CheckCount(const std::string& path, const Entries& entries,
                        std::int64_t expected, const char* name) {
  const auto found = static_cast<std::int64_t>(entries.values.size());
  if (found == expected) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("'", path, "': ", found, " entries, expected ", expected,
                   ", one for each vertex of ", name));
}

}  // namespace

MapFormat MapFormatOf(const std::string& path) {
  return FormatOfExtension(LowerExtension(path));
}

MapFormat MapFormatOf(const std::string& path, const InputFile& file) {
  if (path != kStandardInput) return FormatOfExtension(file.extension);
  if (absl::StartsWith(file.bytes, kNpyMagic)) return MapFormat::kNpy;
  return absl::StartsWith(absl::StripLeadingAsciiWhitespace(file.bytes), "{")
             ? MapFormat::kJson
             : MapFormat::kText;
}

std::string FormatMap(absl::Span<const VertexIndex> y_from_x) {
  std::string text;
  for (const VertexIndex y : y_from_x) absl::StrAppend(&text, y, "\n");
  return text;
}

std::string FormatMap(absl::Span<const VertexIndex> y_from_x,
                      std::int64_t vertices_y, MapFormat format) {
  assert(format != MapFormat::kPly);
  const std::vector<std::int64_t> numbers(y_from_x.begin(), y_from_x.end());
  if (format == MapFormat::kNpy) return FormatNpy(numbers);
  if (format == MapFormat::kText) return FormatMap(y_from_x);
  const Json json = {{"format", kJsonFormat},
                     {"version", kJsonVersion},
                     {"vertices_x", numbers.size()},
                     {"vertices_y", vertices_y},
                     {"y_from_x", numbers}};
  return json.dump() + "\n";
}

absl::StatusOr<VertexMap> ReadMap(const std::string& path,
                                  std::int64_t vertices_y,
                                  std::optional<std::int64_t> vertices_x) {
  ISOMATCH_ASSIGN_OR_RETURN(const InputFile file, ReadInput(path, kMapLines));
  return ParseMap(path, file, vertices_y, vertices_x);
}

absl::StatusOr<VertexMap> ParseMap(const std::string& path,
                                   const InputFile& file,
                                   std::int64_t vertices_y,
                                   std::optional<std::int64_t> vertices_x) {
  ISOMATCH_ASSIGN_OR_RETURN(const Entries entries,
                            MapEntries(path, file, vertices_y));
  if (vertices_x) {
    ISOMATCH_RETURN_IF_ERROR(CheckCount(path, entries, *vertices_x, "X"));
  }
  VertexMap y_from_x;
  y_from_x.reserve(entries.values.size());
  for (std::size_t i = 0; i < entries.values.size(); ++i) {
    const std::int64_t y = entries.values[i];
    if (y < kNoVertex || y >= vertices_y) {
      return absl::InvalidArgumentError(
          absl::StrCat(entries.Where(path, i), ": y is ", y, ", expected ",
                       kNoVertex, " to ", vertices_y - 1, " (0-based)"));
    }
    y_from_x.push_back(static_cast<VertexIndex>(y));
  }
  return y_from_x;
}

absl::StatusOr<std::vector<std::int64_t>> ReadLabels(const std::string& path,
                                                     std::int64_t vertices) {
  constexpr char kLabels[] = "labels: one whole number a line";
  ISOMATCH_ASSIGN_OR_RETURN(const InputFile file, ReadInput(path, kLabels));
  absl::StatusOr<Entries> entries =
      MapFormatOf(path, file) == MapFormat::kNpy
          ? EntriesFromNpy(path, file.bytes)
          : EntriesFromText(path, file.bytes, "label", kLabels);
  if (!entries.ok()) return entries.status();
  ISOMATCH_RETURN_IF_ERROR(CheckCount(path, *entries, vertices, "Y"));
  return std::move(entries->values);
}

std::string FormatLabels(const std::string& path,
                         absl::Span<const std::int64_t> labels) {
  if (MapFormatOf(path) == MapFormat::kNpy) return FormatNpy(labels);
  std::string text;
  for (const std::int64_t label : labels) absl::StrAppend(&text, label, "\n");
  return text;
}

absl::StatusOr<std::vector<VertexMatch>> ReadLandmarks(
    const std::string& path, std::int64_t vertices_x, std::int64_t vertices_y) {
  constexpr char kLandmarks[] = "landmarks: lines `x y`";
  ISOMATCH_ASSIGN_OR_RETURN(const InputFile file, ReadInput(path, kLandmarks));
  ISOMATCH_ASSIGN_OR_RETURN(const std::vector<NumberLine> lines,
                            NumberLines(path, file.bytes, kLandmarks));
  std::vector<VertexMatch> landmarks;
  Partners of_x = {"X", {}};
  Partners of_y = {"Y", {}};
  for (const NumberLine& line : lines) {
    ISOMATCH_RETURN_IF_ERROR(CheckColumns(path, line, 2, "x y"));
    ISOMATCH_RETURN_IF_ERROR(CheckVertex(path, line, 0, {"x", 0, vertices_x}));
    ISOMATCH_RETURN_IF_ERROR(CheckVertex(path, line, 1, {"y", 0, vertices_y}));
    const auto x = static_cast<VertexIndex>(line.numbers[0]);
    const auto y = static_cast<VertexIndex>(line.numbers[1]);
    ISOMATCH_RETURN_IF_ERROR(CheckPartner(path, line.line, x, y, of_x));
    ISOMATCH_RETURN_IF_ERROR(CheckPartner(path, line.line, y, x, of_y));
    landmarks.push_back({x, y});
  }
  return landmarks;
}

absl::StatusOr<GroundTruth> ReadGroundTruth(const std::string& path,
                                            std::int64_t vertices_x,
                                            std::int64_t vertices_y) {
  constexpr char kTruth[] =
      "a ground truth: lines `x y`, `x y y_mirrored` or one bare y for each "
      "vertex of X";
  ISOMATCH_ASSIGN_OR_RETURN(const InputFile file, ReadInput(path, kTruth));
  if (MapFormatOf(path, file) != MapFormat::kText) {
    ISOMATCH_ASSIGN_OR_RETURN(VertexMap map,
                              ParseMap(path, file, vertices_y, vertices_x));
    return GroundTruth{std::move(map), {}};
  }
  ISOMATCH_ASSIGN_OR_RETURN(const std::vector<NumberLine> lines,
                            NumberLines(path, file.bytes, kTruth));
  switch (lines.front().numbers.size()) {
    case 1:
      return TruthFromColumn(path, lines, vertices_x, vertices_y);
    case 2:
    case 3:
      return TruthFromPairs(path, lines, vertices_x, vertices_y);
    default:
      return LineError(path, lines.front().line,
                       absl::StrCat("found ", lines.front().numbers.size(),
                                    " numbers, expected 1 (y), 2 (x y) or 3 "
                                    "(x y y_mirrored)"));
  }
}

}  // namespace isomatch
