#include "client/map_file.h"

#include <cstddef>
#include <unordered_map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "client/text_file.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

absl::StatusOr<std::vector<NumberLine>> ReadNumberLines(
    const std::string& path, const std::string& what) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::string text, ReadFile(path, what));
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

// Checks the number in `column`, called `name`, against [first, end).
absl::Status CheckVertex(const std::string& path, const NumberLine& line,
                         std::size_t column, const char* name,
                         std::int64_t first, std::int64_t end) {
  const std::int64_t found = line.numbers[column];
  if (first <= found && found < end) return absl::OkStatus();
  return LineError(path, line.line,
                   absl::StrCat(name, " is ", found, ", expected ", first,
                                " to ", end - 1, " (0-based)"));
}

// Remembers in `partner` that `from` goes with `to`; an error when it went with
// another one before.
absl::Status CheckPartner(
    const std::string& path, int line, const char* name, VertexIndex from,
    VertexIndex to, std::unordered_map<VertexIndex, VertexIndex>& partner) {
  const auto [entry, is_new] = partner.emplace(from, to);
  if (is_new || entry->second == to) return absl::OkStatus();
  return LineError(
      path, line,
      absl::StrCat("vertex ", from, " of ", name, " is matched to ", to,
                   " and before to ", entry->second, ", expected one partner"));
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
        CheckVertex(path, line, 0, "y", kNoVertex, vertices_y));
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
  GroundTruth truth{none, columns == 3 ? none : VertexMap{}};
  for (const NumberLine& line : lines) {
    ISOMATCH_RETURN_IF_ERROR(CheckColumns(
        path, line, columns, columns == 3 ? "x y y_mirrored" : "x y"));
    ISOMATCH_RETURN_IF_ERROR(CheckVertex(path, line, 0, "x", 0, vertices_x));
    ISOMATCH_RETURN_IF_ERROR(
        CheckVertex(path, line, 1, "y", kNoVertex, vertices_y));
    const auto x = static_cast<std::size_t>(line.numbers[0]);
    truth.direct[x] = static_cast<VertexIndex>(line.numbers[1]);
    if (columns < 3) continue;
    ISOMATCH_RETURN_IF_ERROR(
        CheckVertex(path, line, 2, "y_mirrored", kNoVertex, vertices_y));
    truth.mirrored[x] = static_cast<VertexIndex>(line.numbers[2]);
  }
  return truth;
}

}  // namespace

std::string FormatMap(absl::Span<const VertexIndex> y_from_x) {
  std::string text;
  for (const VertexIndex y : y_from_x) absl::StrAppend(&text, y, "\n");
  return text;
}

absl::StatusOr<VertexMap> ReadMap(const std::string& path,
                                  std::int64_t vertices_y) {
  ISOMATCH_ASSIGN_OR_RETURN(
      const std::vector<NumberLine> lines,
      ReadNumberLines(path, "a map: one vertex index of Y a line"));
  VertexMap y_from_x;
  for (const NumberLine& line : lines) {
    ISOMATCH_RETURN_IF_ERROR(CheckColumns(path, line, 1, "y"));
    ISOMATCH_RETURN_IF_ERROR(
        CheckVertex(path, line, 0, "y", kNoVertex, vertices_y));
    y_from_x.push_back(static_cast<VertexIndex>(line.numbers[0]));
  }
  return y_from_x;
}

absl::StatusOr<std::vector<VertexMatch>> ReadLandmarks(
    const std::string& path, std::int64_t vertices_x, std::int64_t vertices_y) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::vector<NumberLine> lines,
                            ReadNumberLines(path, "landmarks: lines `x y`"));
  std::vector<VertexMatch> landmarks;
  std::unordered_map<VertexIndex, VertexIndex> y_of_x;
  std::unordered_map<VertexIndex, VertexIndex> x_of_y;
  for (const NumberLine& line : lines) {
    ISOMATCH_RETURN_IF_ERROR(CheckColumns(path, line, 2, "x y"));
    ISOMATCH_RETURN_IF_ERROR(CheckVertex(path, line, 0, "x", 0, vertices_x));
    ISOMATCH_RETURN_IF_ERROR(CheckVertex(path, line, 1, "y", 0, vertices_y));
    const auto x = static_cast<VertexIndex>(line.numbers[0]);
    const auto y = static_cast<VertexIndex>(line.numbers[1]);
    ISOMATCH_RETURN_IF_ERROR(CheckPartner(path, line.line, "X", x, y, y_of_x));
    ISOMATCH_RETURN_IF_ERROR(CheckPartner(path, line.line, "Y", y, x, x_of_y));
    landmarks.push_back({x, y});
  }
  return landmarks;
}

absl::StatusOr<GroundTruth> ReadGroundTruth(const std::string& path,
                                            std::int64_t vertices_x,
                                            std::int64_t vertices_y) {
  ISOMATCH_ASSIGN_OR_RETURN(
      const std::vector<NumberLine> lines,
      ReadNumberLines(path,
                      "a ground truth: lines `x y`, `x y y_mirrored` or "
                      "one bare y for each vertex of X"));
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
