#include "client/files/obj_reader.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/algorithm/container.h"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "client/files/text_colors.h"
#include "client/files/text_file.h"
#include "client/files/word_cursor.h"

namespace isomatch {
namespace {

using Words = std::vector<absl::string_view>;

// Decimal; SimpleAtod takes hexadecimal digits too.
bool ReadCoordinate(absl::string_view word, double* number) {
  return ReadFinite(word, number) &&
         word.find_first_of("xX") == absl::string_view::npos;
}

// Statements that are no part of a surface's shape.
constexpr auto kIgnored = std::to_array<absl::string_view>(
    {"vn",        "vp",       "g",        "o",   "s",
     "mg",        "usemap",   "maplib",   "l",   "p",
     "bevel",     "c_interp", "d_interp", "lod", "shadow_obj",
     "trace_obj", "illum",    "cstype",   "deg", "ctech"});
// Statements about free-form curves and surfaces, which have no triangles.
constexpr auto kFreeForm = std::to_array<absl::string_view>(
    {"curv", "curv2", "surf", "parm", "trim", "hole", "scrv", "sp", "end",
     "con", "bmat", "step", "stech"});

// A 1-based number, or one that counts back from the last of `count`, as
// 0-based; nothing for another word.
std::optional<VertexIndex> ReadIndex(absl::string_view word,
                                     std::size_t count) {
  const auto last = static_cast<std::int64_t>(count);
  VertexIndex number = 0;
  if (!absl::SimpleAtoi(word, &number) || number == 0 || number < -last) {
    return std::nullopt;
  }
  return static_cast<VertexIndex>(number > 0 ? number - 1 : last + number);
}

// Takes a line off the front of `rest`, without its end.
absl::string_view TakeLine(absl::string_view& rest) {
  const std::size_t end = rest.find('\n');
  const absl::string_view line = rest.substr(0, end);
  rest.remove_prefix(end == absl::string_view::npos ? rest.size() : end + 1);
  return absl::StripAsciiWhitespace(line.substr(0, line.find('#')));
}

class ObjReader {
 public:
  explicit ObjReader(PolygonSoup* soup) : soup_(soup), colors_(soup) {
    soup->format = "OBJ";
  }

  // A line that ends with a backslash goes on in the next one.
  std::optional<MeshFault> Read(absl::string_view text) {
    std::string joined;
    for (int lines = 0; !text.empty();) {
      absl::string_view statement = TakeLine(text);
      line_ = ++lines;
      if (absl::EndsWith(statement, "\\")) {
        joined.clear();
        while (absl::ConsumeSuffix(&statement, "\\")) {
          absl::StrAppend(&joined, statement, " ");
          statement = TakeLine(text);
          ++lines;
        }
        absl::StrAppend(&joined, statement);
        statement = absl::StripAsciiWhitespace(joined);
      }
      if (statement.empty()) continue;
      if (auto fault = ReadStatement(statement)) return fault;
    }
    colors_.Finish(colors_.largest() > 1 ? 255 : 1);
    Warn();
    return CheckIndices();
  }

 private:
  std::optional<MeshFault> ReadStatement(absl::string_view statement) {
    const Words words = SplitWords(statement);
    const absl::string_view kind = words[0];
    // Names may have blanks.
    const absl::string_view name =
        absl::StripAsciiWhitespace(statement.substr(kind.size()));
    if (kind == "v") return ReadVertex(words);
    if (kind == "f") return ReadFace(words);
    if (kind == "vt") {
      ReadCoordinates(words);
    } else if (kind == "mtllib") {
      soup_->texture.libraries.emplace_back(name);
    } else if (kind == "usemtl") {
      UseMaterial(std::string(name));
    } else if (absl::c_linear_search(kFreeForm, kind)) {
      ++free_form_;
    } else if (!absl::c_linear_search(kIgnored, kind) && unknown_++ == 0) {
      first_unknown_ = absl::StrCat(Quoted(kind), " in line ", line_);
    }
    return std::nullopt;
  }

  std::optional<MeshFault> ReadVertex(const Words& words) {
    if (words.size() < 4) {
      return FaultHere(absl::StrCat("a vertex has ", words.size() - 1,
                                    " coordinates, expected `v x y z`"));
    }
    std::array<double, 3>& point = soup_->points.emplace_back();
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const absl::string_view word = words[axis + 1];
      if (ReadCoordinate(word, &point[axis])) continue;
      return FaultHere(
          absl::StrCat("a coordinate is ", Quoted(word),
                       ", expected `v x y z` with finite numbers"));
    }
    colors_.Add(absl::MakeConstSpan(words).subspan(4), line_);
    return std::nullopt;
  }

  std::optional<MeshFault> ReadFace(const Words& words) {
    if (words.size() < 4) {
      return FaultHere(absl::StrCat("a face has ", words.size() - 1,
                                    " corners, expected 3 or more"));
    }
    for (std::size_t i = 1; i < words.size(); ++i) {
      if (auto fault = ReadCorner(words[i])) return fault;
    }
    soup_->sizes.push_back(static_cast<VertexIndex>(words.size() - 1));
    lines_.push_back(line_);
    if (material_ >= 0) {
      std::vector<int>& materials = soup_->texture.material_of_polygon;
      materials.resize(soup_->sizes.size(), -1);
      materials.back() = material_;
    }
    return std::nullopt;
  }

  std::optional<MeshFault> ReadCorner(absl::string_view word) {
    const std::size_t count = soup_->points.size();
    const std::size_t slash = word.find('/');
    const auto vertex = ReadIndex(word.substr(0, slash), count);
    if (!vertex) {
      return FaultHere(
          absl::StrCat("a face's corner is ", Quoted(word),
                       ", expected V, V/VT, V//VN or V/VT/VN with V from 1 to ",
                       std::numeric_limits<VertexIndex>::max(), ", or from -",
                       count, " to -1 to count back"));
    }
    soup_->corners.push_back(*vertex);
    if (slash == absl::string_view::npos) return std::nullopt;
    const absl::string_view after = word.substr(slash + 1);
    const absl::string_view number = after.substr(0, after.find('/'));
    if (!number.empty()) ReadCornerCoordinates(word, number);
    return std::nullopt;
  }

  void ReadCornerCoordinates(absl::string_view word, absl::string_view number) {
    SoupTexture& texture = soup_->texture;
    const std::size_t count = texture.coordinates.size();
    const auto index = ReadIndex(number, count);
    if (!index || static_cast<std::size_t>(*index) >= count) {
      return FailTexture(
          absl::StrCat("a corner's texture coordinates are ", Quoted(word),
                       ", expected V/VT with VT from 1 to ", count,
                       ", the number of lines vt so far"));
    }
    texture.coordinates_of_corner.resize(soup_->corners.size(), -1);
    texture.coordinates_of_corner.back() = *index;
  }

  void ReadCoordinates(const Words& words) {
    std::array<double, 2> point = {0, 0};  // v may be left out
    if (words.size() < 2 || !ReadFinite(words[1], &point[0]) ||
        (words.size() > 2 && !ReadFinite(words[2], &point[1]))) {
      return FailTexture("expected `vt u v` with finite numbers");
    }
    soup_->texture.coordinates.push_back(point);
  }

  void UseMaterial(const std::string& name) {
    if (name == kNoMaterial) {
      material_ = -1;
      return;
    }
    std::vector<std::string>& materials = soup_->texture.materials;
    const auto [entry, is_new] =
        number_of_material_.emplace(name, static_cast<int>(materials.size()));
    if (is_new) materials.push_back(name);
    material_ = entry->second;
  }

  // A face may stand before its vertices.
  std::optional<MeshFault> CheckIndices() const {
    const std::size_t count = soup_->points.size();
    std::size_t corner = 0;
    for (std::size_t f = 0; f < soup_->sizes.size(); ++f) {
      for (VertexIndex i = 0; i < soup_->sizes[f]; ++i) {
        const auto v = static_cast<std::size_t>(soup_->corners[corner++]);
        if (v < count) continue;
        return MeshFault{
            absl::StrCat("line ", lines_[f]),
            absl::StrCat("a face names vertex ", v + 1, ", expected 1 to ",
                         count, ", the number of lines `v x y z`")};
      }
    }
    return std::nullopt;
  }

  MeshFault FaultHere(std::string what) const {
    return {absl::StrCat("line ", line_), std::move(what)};
  }

  void FailTexture(std::string what) {
    if (soup_->texture_fault) return;
    soup_->texture_fault = FaultHere(std::move(what));
  }

  void Warn() {
    if (free_form_ > 0) {
      soup_->warnings.push_back(
          absl::StrCat(free_form_,
                       " lines of free-form curves and surfaces are left out: "
                       "expected polygons, lines `f a b c`"));
    }
    if (unknown_ > 0) {
      soup_->warnings.push_back(absl::StrCat(
          unknown_, " lines that are no statements of OBJ are left out, first ",
          first_unknown_));
    }
  }

  PolygonSoup* const soup_;
  TextColors colors_;
  // Where the statement begins.
  int line_ = 0;
  // The line at which each polygon begins.
  std::vector<int> lines_;
  int material_ = -1;
  std::map<std::string, int> number_of_material_;
  std::int64_t free_form_ = 0;
  std::int64_t unknown_ = 0;
  std::string first_unknown_;
};

}  // namespace

std::optional<MeshFault> ReadObjSoup(absl::string_view text,
                                     PolygonSoup* soup) {
  return ObjReader(soup).Read(text);
}

}  // namespace isomatch
