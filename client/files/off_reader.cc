#include "client/files/off_reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

#include "absl/algorithm/container.h"
#include "absl/status/statusor.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/types/span.h"
#include "client/files/text_colors.h"
#include "client/files/text_file.h"
#include "client/files/word_cursor.h"

namespace isomatch {
namespace {

// The shortest that can be written: "0 0 0\n" and "3 0 1 2".
constexpr std::int64_t kVertexBytes = 6;
constexpr std::int64_t kFaceBytes = 7;

// Also a number with a decimal point, as tables of numbers are written.
bool ReadWhole(absl::string_view word, std::int64_t* number) {
  if (ReadPlain(word, number)) return true;
  double found = 0;
  constexpr double kMost = 1e15;
  if (!ReadFinite(word, &found) || std::floor(found) != found ||
      std::abs(found) > kMost) {
    return false;
  }
  *number = static_cast<std::int64_t>(found);
  return true;
}

class OffReader {
 public:
  OffReader(absl::string_view text, PolygonSoup* soup)
      : bytes_(static_cast<std::int64_t>(text.size())),
        cursor_(text),
        colors_(soup),
        soup_(soup) {
    soup->format = "OFF";
  }

  std::optional<MeshFault> Read() {
    if (auto fault = ReadHeader()) return fault;
    soup_->points.reserve(static_cast<std::size_t>(vertices_));
    for (std::int64_t v = 0; v < vertices_; ++v) {
      if (auto fault = ReadVertex(v)) return fault;
    }
    colors_.Finish(colors_.has_fractions() ? 1 : 255);
    soup_->sizes.reserve(static_cast<std::size_t>(faces_));
    soup_->corners.reserve(3 * static_cast<std::size_t>(faces_));
    for (std::int64_t f = 0; f < faces_; ++f) {
      if (auto fault = ReadFace(f)) return fault;
    }
    if (cursor_.LeftAhead() > 0) {
      cursor_.Take();
      soup_->warnings.push_back(
          absl::StrCat(cursor_.Where(),
                       " and what follows is not read: the "
                       "header says ",
                       vertices_, " vertices and ", faces_, " faces"));
    }
    return std::nullopt;
  }

 private:
  std::optional<MeshFault> ReadHeader() {
    const absl::string_view kind = cursor_.Take();
    if (!absl::EndsWith(kind, "OFF")) {
      return MeshFault{"", "expected the letters OFF at its beginning"};
    }
    if (absl::EndsWith(kind, "nOFF")) {
      return MeshFault{"", "expected coordinates in space, OFF, not nOFF"};
    }
    is_homogeneous_ = absl::EndsWith(kind, "4OFF");
    has_normals_ = absl::StrContains(kind, "N");
    if (auto fault = ReadCount("vertices", &vertices_)) return fault;
    if (auto fault = ReadCount("faces", &faces_)) return fault;
    // The number of edges says nothing; it may be missing, or stand alone.
    if (cursor_.LeftOnLine() > 0) {
      cursor_.TakeRestOfLine();
    } else if (cursor_.LeftAhead() == 1) {
      cursor_.Take();
    }
    const std::int64_t needed = vertices_ * kVertexBytes + faces_ * kFaceBytes;
    if (needed <= bytes_) return std::nullopt;
    return MeshFault{
        "", absl::StrCat("the header claims ", vertices_, " vertices and ",
                         faces_, " faces, which takes at least ", needed,
                         " bytes, but the file has ", bytes_)};
  }

  std::optional<MeshFault> ReadCount(const char* of, std::int64_t* count) {
    const auto found = ParseHeaderCount(cursor_.Take(), of);
    if (!found.ok()) {
      return MeshFault{cursor_.Where(), std::string(found.status().message())};
    }
    *count = *found;
    return std::nullopt;
  }

  std::optional<MeshFault> ReadVertex(std::int64_t v) {
    constexpr std::array<const char*, 4> kNames = {"x", "y", "z", "w"};
    std::array<double, 4> numbers = {0, 0, 0, 1};
    const std::size_t count = is_homogeneous_ ? 4 : 3;
    if (!has_normals_ &&
        cursor_.TakeNumbers(absl::MakeSpan(numbers.data(), count), [&] {
          return absl::c_all_of(numbers,
                                [](double n) { return std::isfinite(n); });
        })) {
      return AddVertex(v, numbers, {});
    }
    int first_line = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const absl::string_view word = cursor_.Take();
      if (word.empty()) return Ends("vertex", v);
      if (i == 0) first_line = cursor_.line();
      if (ReadFinite(word, &numbers[i])) continue;
      return MeshFault{
          cursor_.Where(),
          absl::StrCat(kNames[i], " of vertex ", v, " (0-based) is ",
                       Quoted(word), ", expected a finite number")};
    }
    const auto rest = cursor_.TakeRestOfLine();
    if (cursor_.line() != first_line && !rest.empty()) {
      return MeshFault{absl::StrCat("line ", first_line),
                       absl::StrCat("vertex ", v, " (0-based) has less than ",
                                    count, " numbers")};
    }
    const std::size_t normals = has_normals_ ? 3 : 0;
    return AddVertex(v, numbers, rest.subspan(std::min(normals, rest.size())));
  }

  std::optional<MeshFault> AddVertex(
      std::int64_t v, const std::array<double, 4>& numbers,
      absl::Span<const absl::string_view> color) {
    colors_.Add(color, cursor_.line());
    const double w = numbers[3];
    soup_->points.push_back({numbers[0] / w, numbers[1] / w, numbers[2] / w});
    if (w != 0) return std::nullopt;
    return MeshFault{cursor_.Where(),
                     absl::StrCat("w of vertex ", v,
                                  " (0-based) is 0, expected another number")};
  }

  // Takes a line `3 a b c`, as nearly all are.
  bool TakeTriangle() {
    std::array<std::int64_t, 4> line;
    const bool is_taken = cursor_.TakeNumbers(absl::MakeSpan(line), [&] {
      return line[0] == 3 && absl::c_all_of(line, [&](std::int64_t vertex) {
               return vertex >= 0 && vertex < vertices_;
             });
    });
    if (!is_taken) return false;
    soup_->corners.insert(soup_->corners.end(), line.begin() + 1, line.end());
    soup_->sizes.push_back(3);
    return true;
  }

  std::optional<MeshFault> ReadFace(std::int64_t f) {
    if (TakeTriangle()) return std::nullopt;
    const absl::string_view size = cursor_.Take();
    if (size.empty()) return Ends("face", f);
    std::int64_t corners = 0;
    if (!ReadWhole(size, &corners) || corners < 3) {
      return MeshFault{cursor_.Where(),
                       absl::StrCat("face ", f, " (0-based) has ", Quoted(size),
                                    " corners, expected 3 or more")};
    }
    for (std::int64_t corner = 0; corner < corners; ++corner) {
      const absl::string_view word = cursor_.Take();
      if (word.empty()) return Ends("face", f);
      std::int64_t vertex = 0;
      if (!ReadWhole(word, &vertex) || vertex < 0 || vertex >= vertices_) {
        return MeshFault{
            cursor_.Where(),
            absl::StrCat("face ", f, " (0-based) names vertex ", Quoted(word),
                         ", expected 0 to ", vertices_ - 1)};
      }
      soup_->corners.push_back(static_cast<VertexIndex>(vertex));
    }
    cursor_.TakeRestOfLine();  // the face's color
    soup_->sizes.push_back(static_cast<VertexIndex>(corners));
    return std::nullopt;
  }

  MeshFault Ends(const char* kind, std::int64_t item) const {
    return {cursor_.Where(),
            absl::StrCat("the file ends in ", kind, " ", item,
                         " (0-based), expected ", vertices_, " vertices and ",
                         faces_, " faces as its header says, one a line")};
  }

  const std::int64_t bytes_;
  WordCursor cursor_;
  TextColors colors_;
  PolygonSoup* const soup_;
  bool is_homogeneous_ = false;
  bool has_normals_ = false;
  std::int64_t vertices_ = 0;
  std::int64_t faces_ = 0;
};

}  // namespace

std::optional<MeshFault> ReadOffSoup(absl::string_view text,
                                     PolygonSoup* soup) {
  return OffReader(text, soup).Read();
}

}  // namespace isomatch
