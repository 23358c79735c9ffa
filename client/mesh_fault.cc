#include "client/mesh_fault.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "absl/status/statusor.h"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "client/ply_file.h"
#include "client/word_cursor.h"

namespace isomatch {
namespace {

constexpr std::array<const char*, 3> kAxes = {"x", "y", "z"};

// Reads what follows the header of a PLY file.
class PlyChecker {
 public:
  PlyChecker(const PlyHeader& header, absl::string_view bytes,
             absl::string_view rest)
      : header_(header), bytes_(bytes), body_(rest, header.format) {
    for (const PlyElement& element : header.elements) {
      if (element.name == "vertex") vertices_ = element.count;
    }
  }

  std::optional<MeshFault> Check() {
    for (const PlyElement& element : header_.elements) {
      // Of nothing there can be any number, and a reader would count to it.
      if (element.properties.empty() && element.count > 0) {
        return MeshFault{"", absl::StrCat("the header's element ", element.name,
                                          " has no properties")};
      }
      for (item_ = 0; item_ < element.count; ++item_) {
        for (const PlyProperty& property : element.properties) {
          if (!CheckProperty(element, property)) return fault_;
        }
      }
    }
    return std::nullopt;
  }

 private:
  bool CheckProperty(const PlyElement& element, const PlyProperty& property) {
    if (property.count_type) return CheckList(element, property);
    const bool is_coordinate =
        element.name == "vertex" &&
        (property.name == "x" || property.name == "y" || property.name == "z");
    if (!is_coordinate && header_.format != PlyFormat::kAscii) {
      return body_.Skip(1, property.type) || FailAtEnd(element);
    }
    const std::optional<double> number = body_.TakeNumber(property.type);
    if (!number) return FailAtNumber(element, "a number");
    if (!is_coordinate || std::isfinite(*number)) return true;
    return Fail(absl::StrCat(property.name, " of vertex ", item_,
                             " (0-based) is ", *number,
                             ", expected a finite number"));
  }

  bool CheckList(const PlyElement& element, const PlyProperty& property) {
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
    const bool is_face =
        element.name == "face" &&
        (property.name == "vertex_indices" || property.name == "vertex_index");
    if (!is_face) {
      return body_.Skip(*length, property.type) ||
             FailAtNumber(element, "a number");
    }
    if (*length < 3) {
      return Fail(absl::StrCat("face ", item_, " (0-based) has ", *length,
                               " corners, expected 3 or more"));
    }
    return CheckCorners(element, property, *length);
  }

  bool CheckCorners(const PlyElement& element, const PlyProperty& property,
                    std::int64_t corners) {
    for (; corners > 0; --corners) {
      const std::optional<double> vertex = body_.TakeNumber(property.type);
      if (!vertex) return FailAtNumber(element, "a number of a vertex");
      if (0 <= *vertex && *vertex < static_cast<double>(vertices_) &&
          *vertex == std::floor(*vertex)) {
        continue;
      }
      return Fail(absl::StrCat("face ", item_, " (0-based) names vertex ",
                               *vertex, ", expected 0 to ", vertices_ - 1));
    }
    return true;
  }

  // Each returns false.
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
      fault_.place = absl::StrCat(
          "line ", 1 + std::count(taken.begin(), taken.end(), '\n'));
    }
    return false;
  }

  const PlyHeader& header_;
  const absl::string_view bytes_;
  PlyBody body_;
  std::int64_t vertices_ = 0;
  std::int64_t item_ = 0;
  MeshFault fault_;
};

constexpr std::size_t kStlHeaderBytes = 84;
constexpr std::size_t kStlTriangleBytes = 50;

std::uint32_t StlTriangles(absl::string_view bytes) {
  std::uint32_t triangles = 0;
  std::memcpy(&triangles, bytes.data() + kStlHeaderBytes - sizeof(triangles),
              sizeof(triangles));
  return triangles;
}

std::optional<MeshFault> FindBinaryStlFault(absl::string_view bytes) {
  if (bytes.size() < kStlHeaderBytes) {
    return MeshFault{
        "", absl::StrCat("the file has ", bytes.size(),
                         " bytes, expected text that begins with `solid`, or ",
                         kStlHeaderBytes, " bytes and the triangles")};
  }
  const std::uint32_t triangles = StlTriangles(bytes);
  const std::size_t held = (bytes.size() - kStlHeaderBytes) / kStlTriangleBytes;
  if (held < triangles) {
    return MeshFault{
        "", absl::StrCat("the header claims ", triangles,
                         " triangles, but the file has bytes for ", held)};
  }
  for (std::size_t t = 0; t < triangles; ++t) {
    // Normal, three corners, two bytes.
    std::array<float, 12> numbers;
    std::memcpy(numbers.data(),
                bytes.data() + kStlHeaderBytes + t * kStlTriangleBytes,
                sizeof(numbers));
    for (std::size_t i = 3; i < numbers.size(); ++i) {
      if (std::isfinite(numbers[i])) continue;
      return MeshFault{
          absl::StrCat("triangle ", t, " (0-based)"),
          absl::StrCat(kAxes[i % 3], " of corner ", i / 3 - 1, " (0-based) is ",
                       numbers[i], ", expected a finite number")};
    }
  }
  return std::nullopt;
}

std::optional<MeshFault> FindTextStlFault(absl::string_view text) {
  WordCursor cursor(text);
  std::int64_t triangles = 0;
  int corners = 0;
  bool has_ended = false;
  absl::string_view word;
  while (!(word = cursor.Take()).empty()) {
    // The name of a solid may have any words.
    if (word == "solid" || word == "endsolid") {
      has_ended = word == "endsolid" && corners == 0;
      cursor.DropLine();
    }
    if (word == "endloop" && corners != 3) {
      return MeshFault{cursor.Place(),
                       absl::StrCat("triangle ", triangles, " (0-based) has ",
                                    corners, " corners, expected 3")};
    }
    if (word == "endloop") {
      corners = 0;
      ++triangles;
    }
    if (word != "vertex") continue;
    ++corners;
    for (const char* axis : kAxes) {
      const absl::string_view number = cursor.Take();
      double finite = 0;
      if (ReadFinite(number, &finite)) continue;
      return MeshFault{cursor.Place(),
                       absl::StrCat(axis, " of a corner of triangle ",
                                    triangles, " (0-based) is ", Quoted(number),
                                    ", expected a finite number")};
    }
  }
  if (has_ended) return std::nullopt;
  return MeshFault{cursor.Place(),
                   absl::StrCat("the file ends after ", triangles,
                                " triangles without `endsolid`")};
}

}  // namespace

std::optional<MeshFault> FindPlyFault(absl::string_view bytes) {
  if (!absl::StartsWith(bytes, "ply")) {
    return MeshFault{"", "expected the letters ply at its beginning"};
  }
  absl::string_view rest = bytes;
  const absl::StatusOr<PlyHeader> header = TakePlyHeader(rest);
  if (!header.ok()) {
    return MeshFault{"", std::string(header.status().message())};
  }
  return PlyChecker(*header, bytes, rest).Check();
}

std::optional<MeshFault> FindStlFault(absl::string_view bytes) {
  // Headers of binary files may begin with "solid" too; as a number, letters of
  // a text are more triangles than it has bytes for.
  const bool is_binary =
      bytes.size() >= kStlHeaderBytes &&
      kStlHeaderBytes + kStlTriangleBytes * std::size_t{StlTriangles(bytes)} <=
          bytes.size();
  return absl::StartsWith(absl::StripLeadingAsciiWhitespace(bytes), "solid") &&
                 !is_binary
             ? FindTextStlFault(bytes)
             : FindBinaryStlFault(bytes);
}

}  // namespace isomatch
