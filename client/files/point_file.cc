#include "client/files/point_file.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <initializer_list>
#include <optional>
#include <utility>

#include <nlohmann/json.hpp>

#include "absl/algorithm/container.h"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "client/files/input_file.h"
#include "client/files/json_limits.h"
#include "client/files/text_file.h"
#include "client/files/word_cursor.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

using PointJson = nlohmann::ordered_json;

constexpr char kPoints[] =
    "points: .mrk.json or .fcsv of 3D Slicer, or lines `x y z [LABEL]`";
constexpr char kSchema[] =
    "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/"
    "Markups/Resources/Schema/markups-schema-v1.0.3.json#";

absl::Status PointsError(const std::string& path, const std::string& what) {
  return absl::InvalidArgumentError(absl::StrCat("'", path, "': ", what));
}

// LPS or RAS; 0 and 1 are what Slicer 4 wrote for RAS and LPS.
absl::StatusOr<std::string> ParseSpace(const std::string& path,
                                       absl::string_view word) {
  if (word == "LPS" || word == "1") return "LPS";
  if (word == "RAS" || word == "0") return "RAS";
  return PointsError(path, absl::StrCat("the coordinate system is ",
                                        Quoted(word), ", expected LPS or RAS"));
}

// A control point of Markups; none where nobody has placed it.
absl::Status AddControlPoint(const std::string& path, const PointJson& json,
                             PointFile* file) {
  const std::size_t number =
      file->points.size() + static_cast<std::size_t>(file->without_position);
  const auto refuse = [&](const std::string& what) {
    return PointsError(
        path, absl::StrCat("control point ", number, " (0-based): ", what));
  };
  if (!json.is_object()) return refuse("expected an object");
  const PointJson status = json.value("positionStatus", PointJson("defined"));
  const auto position = json.find("position");
  if (status != "defined" || position == json.end()) {
    ++file->without_position;
    return absl::OkStatus();
  }
  if (!position->is_array() || position->size() != 3 ||
      !absl::c_all_of(*position, [](const PointJson& number_of) {
        return number_of.is_number();
      })) {
    return refuse("expected a position of three numbers");
  }
  LandmarkPoint point;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    point.position[static_cast<Eigen::Index>(axis)] =
        (*position)[axis].get<double>();
  }
  const PointJson label = json.value("label", PointJson());
  if (label.is_string()) point.label = label.get<std::string>();
  file->points.push_back(std::move(point));
  return absl::OkStatus();
}

absl::StatusOr<PointFile> ParseMarkups(const std::string& path,
                                       absl::string_view text) {
  if (const auto fault = CheckJsonText(text, {})) {
    return PointsError(
        path, absl::StrCat(
                  fault->byte ? absl::StrCat("byte ", *fault->byte, ": ") : "",
                  fault->what, ", expected ", kPoints));
  }
  const PointJson json =
      PointJson::parse(text, /*cb=*/nullptr, /*allow_exceptions=*/false);
  const auto markups = json.is_object() ? json.find("markups") : json.end();
  if (markups == json.end() || !markups->is_array() || markups->empty() ||
      !markups->front().is_object()) {
    return PointsError(path,
                       "there is no array markups, expected a Markups file of "
                       "3D Slicer");
  }
  // Further lists, if any, are of other things.
  const PointJson& list = markups->front();
  PointFile file;
  const PointJson space = list.value("coordinateSystem", PointJson("LPS"));
  ISOMATCH_ASSIGN_OR_RETURN(
      file.space, ParseSpace(path, space.is_string() ? space.get<std::string>()
                                                     : space.dump()));
  const auto points = list.find("controlPoints");
  if (points == list.end() || !points->is_array()) {
    return PointsError(path, "there is no array controlPoints, expected one");
  }
  for (const PointJson& point : *points) {
    ISOMATCH_RETURN_IF_ERROR(AddControlPoint(path, point, &file));
  }
  return file;
}

absl::string_view WithoutComment(absl::string_view text) {
  return absl::StripAsciiWhitespace(text.substr(0, text.find('#')));
}

// Which word of a line is what; `label` may be beyond its end.
struct Columns {
  std::array<std::size_t, 3> axes = {0, 1, 2};
  std::size_t label = 3;
};

absl::StatusOr<LandmarkPoint> ParsePoint(
    const std::string& path, int line, const Columns& columns,
    const std::vector<std::string>& words) {
  constexpr std::array kAxes = {"x", "y", "z"};
  LandmarkPoint point;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t column = columns.axes[axis];
    double number = 0;
    if (column >= words.size() ||
        !ReadFinite(WithoutComment(words[column]), &number)) {
      return LineError(
          path, line,
          absl::StrCat(
              kAxes[axis], " is ",
              column < words.size() ? Quoted(words[column]) : "missing",
              ", expected a finite number: ", kPoints));
    }
    point.position[static_cast<Eigen::Index>(axis)] = number;
  }
  if (columns.label < words.size()) point.label = words[columns.label];
  return point;
}

// The columns that a header names; none when `words` are no header.
std::optional<Columns> ParseHeader(const std::vector<std::string>& words) {
  const auto find = [&](std::initializer_list<const char*> names) {
    const auto found = absl::c_find_if(words, [&](absl::string_view word) {
      return absl::c_any_of(names, [&](const char* name) {
        return absl::EqualsIgnoreCase(word, name);
      });
    });
    return static_cast<std::size_t>(found - words.begin());
  };
  const Columns columns = {{find({"x"}), find({"y"}), find({"z"})},
                           find({"label", "name", "id"})};
  if (absl::c_linear_search(columns.axes, words.size())) return std::nullopt;
  return columns;
}

// What blanks separate, or commas, where quotes may be around what has some.
std::vector<std::string> SplitRow(absl::string_view line) {
  if (line.find(',') == absl::string_view::npos) {
    const auto words = SplitWords(WithoutComment(line));
    return {words.begin(), words.end()};
  }
  std::vector<std::string> words(1);
  bool is_quoted = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '"') {
      const bool is_doubled =
          is_quoted && i + 1 < line.size() && line[i + 1] == '"';
      if (is_doubled) words.back() += line[++i];
      if (!is_doubled) is_quoted = !is_quoted;
    } else if (line[i] == ',' && !is_quoted) {
      words.emplace_back();
    } else {
      words.back() += line[i];
    }
  }
  for (std::string& word : words) absl::StripAsciiWhitespace(&word);
  return words;
}

// `is_table`: a # within a line is a cell's.
absl::StatusOr<PointFile> ParseRows(const std::string& path,
                                    absl::string_view text, bool is_table) {
  PointFile file;
  Columns columns;
  bool is_first = true;
  LineCursor rows = {text};
  rows.has_comments_behind = !is_table;
  while (rows.Next()) {
    const std::vector<std::string> words = SplitRow(rows.line);
    const auto header = is_first ? ParseHeader(words) : std::nullopt;
    is_first = false;
    if (header) {
      columns = *header;
      continue;
    }
    ISOMATCH_ASSIGN_OR_RETURN(LandmarkPoint point,
                              ParsePoint(path, rows.number, columns, words));
    file.points.push_back(std::move(point));
  }
  return file;
}

// What a comment `# NAME = VALUE` says; "" where there is none.
absl::string_view FcsvValue(absl::string_view text, absl::string_view name) {
  for (absl::string_view line : absl::StrSplit(text, '\n')) {
    const std::pair<absl::string_view, absl::string_view> parts =
        absl::StrSplit(line, absl::MaxSplits('=', 1));
    if (absl::StripAsciiWhitespace(parts.first) == absl::StrCat("# ", name)) {
      return absl::StripAsciiWhitespace(parts.second);
    }
  }
  return "";
}

absl::StatusOr<PointFile> ParseFcsv(const std::string& path,
                                    absl::string_view text) {
  PointFile file;
  const absl::string_view space = FcsvValue(text, "CoordinateSystem");
  // Without it, Slicer 4's own.
  ISOMATCH_ASSIGN_OR_RETURN(file.space,
                            ParseSpace(path, space.empty() ? "RAS" : space));
  const absl::string_view names = FcsvValue(text, "columns");
  const std::optional<Columns> named =
      names.empty() ? std::nullopt : ParseHeader(SplitRow(names));
  if (!names.empty() && !named) {
    return PointsError(path, absl::StrCat("its columns are ", Quoted(names),
                                          ", expected x, y and z among them"));
  }
  Columns columns = {{1, 2, 3}, 11};  // of version 4
  if (named) {
    columns.axes = named->axes;
    const std::vector<std::string> words = SplitRow(names);
    columns.label =
        static_cast<std::size_t>(absl::c_find(words, "label") - words.begin());
  }
  LineCursor rows = {text};
  rows.has_comments_behind = false;
  while (rows.Next()) {
    ISOMATCH_ASSIGN_OR_RETURN(
        LandmarkPoint point,
        ParsePoint(path, rows.number, columns, SplitRow(rows.line)));
    file.points.push_back(std::move(point));
  }
  return file;
}

std::string Number(double number) {
  std::string text;
  AppendNumber(number, &text);
  return text;
}

// A label as a table has it: no comma and no line ends in it.
std::string Word(const std::string& label) {
  std::string word = label;
  std::replace_if(
      word.begin(), word.end(),
      [](unsigned char c) { return c < ' ' || c == ',' || c == '"'; }, ' ');
  return word;
}

}  // namespace

bool IsPointFile(const std::string& path) {
  const std::string extension = LowerExtension(WithoutGz(path));
  return extension == ".json" || extension == ".fcsv" || extension == ".csv";
}

absl::StatusOr<PointFile> ReadPoints(const std::string& path) {
  ISOMATCH_ASSIGN_OR_RETURN(const InputFile input, ReadInput(path, kPoints));
  const absl::string_view text = absl::StripLeadingAsciiWhitespace(input.bytes);
  absl::StatusOr<PointFile> file =
      input.extension == ".json" || absl::StartsWith(text, "{")
          ? ParseMarkups(path, text)
      : input.extension == ".fcsv" || absl::StartsWith(text, "# Markups")
          ? ParseFcsv(path, input.bytes)
          : ParseRows(path, input.bytes, input.extension == ".csv");
  if (file.ok() && file->points.empty()) {
    return PointsError(path, absl::StrCat("no points, expected ", kPoints));
  }
  return file;
}

std::string FormatPoints(const std::string& path, const std::string& space,
                         absl::Span<const LandmarkPoint> points) {
  const std::string said = space.empty() ? "LPS" : space;
  const std::string extension = LowerExtension(path);
  if (extension == ".json") {
    PointJson list = PointJson::array();
    for (const LandmarkPoint& point : points) {
      const Eigen::RowVector3d& at = point.position;
      list.push_back({{"id", absl::StrCat(list.size() + 1)},
                      {"label", point.label},
                      {"position", {at.x(), at.y(), at.z()}}});
    }
    const PointJson json = {{"@schema", kSchema},
                            {"markups",
                             {{{"type", "Fiducial"},
                               {"coordinateSystem", said},
                               {"controlPoints", std::move(list)}}}}};
    return json.dump(2, ' ', /*ensure_ascii=*/false,
                     PointJson::error_handler_t::replace) +
           "\n";
  }
  const bool is_fcsv = extension == ".fcsv";
  std::string text =
      is_fcsv ? absl::StrCat(
                    "# Markups fiducial file version = 4.11\n"
                    "# CoordinateSystem = ",
                    said,
                    "\n# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,"
                    "label,desc,associatedNodeID\n")
              : "x,y,z,label\n";
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::RowVector3d& at = points[i].position;
    const std::string xyz = absl::StrCat(Number(at.x()), ",", Number(at.y()),
                                         ",", Number(at.z()), ",");
    absl::StrAppend(
        &text, is_fcsv ? absl::StrCat(i + 1, ",", xyz, "0,0,0,1,1,1,0,") : xyz,
        Word(points[i].label), is_fcsv ? ",," : "", "\n");
  }
  return text;
}

}  // namespace isomatch
