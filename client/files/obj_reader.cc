#include "client/files/obj_reader.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "absl/algorithm/container.h"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "client/files/text_file.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

using Words = std::vector<absl::string_view>;

// What some editors write before a text in UTF-8.
constexpr absl::string_view kByteOrderMark = "\xEF\xBB\xBF";

// Decimal; SimpleAtod takes hexadecimal digits too.
bool ReadCoordinate(absl::string_view word, double* number) {
  return absl::SimpleAtod(word, number) && std::isfinite(*number) &&
         word.find_first_of("xX") == absl::string_view::npos;
}

// Statements that are no part of a surface's shape.
constexpr auto kIgnored = std::to_array<absl::string_view>(
    {"vt",        "vn",     "vp",       "g",        "o",      "s",
     "mg",        "usemtl", "mtllib",   "usemap",   "maplib", "l",
     "p",         "bevel",  "c_interp", "d_interp", "lod",    "shadow_obj",
     "trace_obj", "illum",  "cstype",   "deg",      "ctech"});
// Of free-form curves and surfaces, which have no triangles.
constexpr auto kFreeForm = std::to_array<absl::string_view>(
    {"curv", "curv2", "surf", "parm", "trim", "hole", "scrv", "sp", "end",
     "con", "bmat", "step", "stech"});

template <std::size_t N>
bool IsOneOf(absl::string_view word,
             const std::array<absl::string_view, N>& words) {
  return absl::c_linear_search(words, word);
}

std::string Cut(absl::string_view word) {
  constexpr std::size_t kMostShown = 40;
  return absl::StrCat("'", word.substr(0, kMostShown), "'");
}

class ObjReader {
 public:
  ObjReader(PolygonSoup* soup, std::vector<std::string>* warnings)
      : soup_(soup), warnings_(warnings) {}

  std::optional<MeshFault> Read(absl::string_view text) {
    const absl::Status status = ForEachObjStatement(
        text, [this](int line, absl::string_view statement) {
          line_ = line;
          return ReadStatement(SplitWords(statement));
        });
    if (!status.ok()) {
      return MeshFault{absl::StrCat("line ", line_),
                       std::string(status.message())};
    }
    Warn();
    return CheckIndices();
  }

 private:
  absl::Status ReadStatement(const Words& words) {
    if (words[0] == "v") return ReadVertex(words);
    if (words[0] == "f") return ReadFace(words);
    if (IsOneOf(words[0], kFreeForm)) {
      ++free_form_;
    } else if (!IsOneOf(words[0], kIgnored)) {
      if (unknown_++ == 0) {
        first_unknown_ = absl::StrCat(Cut(words[0]), " in line ", line_);
      }
    }
    return absl::OkStatus();
  }

  absl::Status ReadVertex(const Words& words) {
    if (words.size() < 4) {
      return absl::InvalidArgumentError(
          absl::StrCat("a vertex has ", words.size() - 1,
                       " coordinates, expected `v x y z`"));
    }
    std::array<double, 3>& point = soup_->points.emplace_back();
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const absl::string_view word = words[axis + 1];
      if (ReadCoordinate(word, &point[axis])) continue;
      return absl::InvalidArgumentError(
          absl::StrCat("a coordinate is ", Cut(word),
                       ", expected `v x y z` with finite numbers"));
    }
    return absl::OkStatus();
  }

  absl::Status ReadFace(const Words& words) {
    if (words.size() < 4) {
      return absl::InvalidArgumentError(absl::StrCat(
          "a face has ", words.size() - 1, " corners, expected 3 or more"));
    }
    std::vector<std::size_t>& polygon = soup_->polygons.emplace_back();
    polygon.reserve(words.size() - 1);
    lines_.push_back(line_);
    for (std::size_t i = 1; i < words.size(); ++i) {
      const absl::string_view word = words[i].substr(0, words[i].find('/'));
      const auto count = static_cast<std::int64_t>(soup_->points.size());
      std::int64_t number = 0;
      if (!absl::SimpleAtoi(word, &number) || number == 0 || number < -count) {
        return absl::InvalidArgumentError(absl::StrCat(
            "a face's corner is ", Cut(words[i]),
            ", expected V, V/VT, V//VN or V/VT/VN with V from 1, or from ",
            -count, " to -1 to count back"));
      }
      polygon.push_back(
          static_cast<std::size_t>(number > 0 ? number - 1 : count + number));
    }
    return absl::OkStatus();
  }

  // A face may stand before its vertices.
  std::optional<MeshFault> CheckIndices() const {
    for (std::size_t f = 0; f < soup_->polygons.size(); ++f) {
      for (const std::size_t v : soup_->polygons[f]) {
        if (v < soup_->points.size()) continue;
        return MeshFault{absl::StrCat("line ", lines_[f]),
                         absl::StrCat("a face names vertex ", v + 1,
                                      ", expected 1 to ", soup_->points.size(),
                                      ", the number of lines `v x y z`")};
      }
    }
    return std::nullopt;
  }

  void Warn() const {
    if (free_form_ > 0) {
      warnings_->push_back(
          absl::StrCat(free_form_,
                       " lines of free-form curves and surfaces are left out: "
                       "expected polygons, lines `f a b c`"));
    }
    if (unknown_ > 0) {
      warnings_->push_back(absl::StrCat(
          unknown_, " lines that are no statements of OBJ are left out, first ",
          first_unknown_));
    }
  }

  PolygonSoup* const soup_;
  std::vector<std::string>* const warnings_;
  int line_ = 0;
  // Of each polygon.
  std::vector<int> lines_;
  std::int64_t free_form_ = 0;
  std::int64_t unknown_ = 0;
  std::string first_unknown_;
};

// Takes a line off the front of `rest`, without its end.
absl::string_view TakeLine(absl::string_view& rest) {
  const std::size_t end = rest.find('\n');
  const absl::string_view line = rest.substr(0, end);
  rest.remove_prefix(end == absl::string_view::npos ? rest.size() : end + 1);
  return absl::StripAsciiWhitespace(line.substr(0, line.find('#')));
}

}  // namespace

absl::Status ForEachObjStatement(
    absl::string_view text,
    absl::FunctionRef<absl::Status(int line, absl::string_view statement)>
        read) {
  int line = 0;
  std::string joined;
  absl::ConsumePrefix(&text, kByteOrderMark);
  while (!text.empty()) {
    absl::string_view statement = TakeLine(text);
    const int first_line = ++line;
    if (absl::EndsWith(statement, "\\")) {
      joined.clear();
      while (absl::ConsumeSuffix(&statement, "\\")) {
        absl::StrAppend(&joined, statement, " ");
        statement = TakeLine(text);
        ++line;
      }
      absl::StrAppend(&joined, statement);
      statement = absl::StripAsciiWhitespace(joined);
    }
    if (statement.empty()) continue;
    ISOMATCH_RETURN_IF_ERROR(read(first_line, statement));
  }
  return absl::OkStatus();
}

std::optional<MeshFault> ReadObjSoup(absl::string_view text, PolygonSoup* soup,
                                     std::vector<std::string>* warnings) {
  return ObjReader(soup, warnings).Read(text);
}

}  // namespace isomatch
