#include "client/files/ply_reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "client/files/ply_file.h"

namespace isomatch {
namespace {

// Reads what follows the header of a PLY file.
class PlyReader {
 public:
  PlyReader(const PlyHeader& header, absl::string_view bytes,
            absl::string_view rest, PolygonSoup* soup)
      : header_(header),
        bytes_(bytes),
        body_(rest, header.format),
        soup_(soup) {
    for (const PlyElement& element : header.elements) {
      if (element.name == "vertex") vertices_ = element.count;
    }
  }

  std::optional<MeshFault> Read() {
    for (const PlyElement& element : header_.elements) {
      // Of nothing there can be any number, and it would be counted to.
      if (element.properties.empty() && element.count > 0) {
        return MeshFault{"", absl::StrCat("the header's element ", element.name,
                                          " has no properties")};
      }
      for (item_ = 0; item_ < element.count; ++item_) {
        for (const PlyProperty& property : element.properties) {
          if (!ReadProperty(element, property)) return fault_;
        }
        if (element.name == "vertex") soup_->points.push_back(point_);
      }
    }
    return CheckIsSurface();
  }

 private:
  std::optional<MeshFault> CheckIsSurface() const {
    bool has_faces = false;
    std::array<int, 3> axes = {};  // how often there are values of each
    for (const PlyElement& element : header_.elements) {
      for (const PlyProperty& property : element.properties) {
        const int axis = AxisOf(element, property);
        if (axis >= 0) ++axes[static_cast<std::size_t>(axis)];
        has_faces |= IsFace(element, property);
      }
    }
    if (axes == std::array{1, 1, 1} && has_faces) return std::nullopt;
    return MeshFault{"",
                     "expected one element vertex with x, y, z and element "
                     "face with list vertex_indices"};
  }

  // 0 to 2 for x to z of a vertex; else -1.
  static int AxisOf(const PlyElement& element, const PlyProperty& property) {
    if (element.name != "vertex" || property.count_type) return -1;
    for (std::size_t axis = 0; axis < kAxisNames.size(); ++axis) {
      if (property.name == kAxisNames[axis]) return static_cast<int>(axis);
    }
    return -1;
  }

  static bool IsFace(const PlyElement& element, const PlyProperty& property) {
    return element.name == "face" && property.count_type &&
           (property.name == "vertex_indices" ||
            property.name == "vertex_index");
  }

  bool ReadProperty(const PlyElement& element, const PlyProperty& property) {
    if (property.count_type) return ReadList(element, property);
    const int axis = AxisOf(element, property);
    if (axis < 0 && header_.format != PlyFormat::kAscii) {
      return body_.Skip(1, property.type) || FailAtEnd(element);
    }
    const std::optional<double> number = body_.TakeNumber(property.type);
    if (!number) return FailAtNumber(element, "a number");
    if (axis < 0) return true;
    point_[static_cast<std::size_t>(axis)] = *number;
    if (std::isfinite(*number)) return true;
    return Fail(absl::StrCat(property.name, " of vertex ", item_,
                             " (0-based) is ", *number,
                             ", expected a finite number"));
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
    std::vector<std::size_t> polygon;
    for (; corners > 0; --corners) {
      const std::optional<double> vertex = body_.TakeNumber(property.type);
      if (!vertex) return FailAtNumber(element, "a number of a vertex");
      if (0 <= *vertex && *vertex < static_cast<double>(vertices_) &&
          *vertex == std::floor(*vertex)) {
        polygon.push_back(static_cast<std::size_t>(*vertex));
        continue;
      }
      return Fail(absl::StrCat("face ", item_, " (0-based) names vertex ",
                               *vertex, ", expected 0 to ", vertices_ - 1));
    }
    soup_->polygons.push_back(std::move(polygon));
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
  PolygonSoup* const soup_;
  std::array<double, 3> point_ = {};
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
