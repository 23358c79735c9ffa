#include "client/files/stl_reader.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "absl/container/flat_hash_map.h"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "client/files/input_file.h"
#include "client/files/word_cursor.h"

namespace isomatch {
namespace {

// Makes vertices of corners, and triangles of three corners each.
class CornerJoiner {
 public:
  explicit CornerJoiner(PolygonSoup* soup) : soup_(soup) {}

  void Add(std::array<double, 3> point) {
    // -0 is 0.
    for (double& coordinate : point) coordinate += 0.0;
    const auto [found, is_new] = vertices_.try_emplace(
        point, static_cast<VertexIndex>(soup_->points.size()));
    if (is_new) soup_->points.push_back(point);
    soup_->corners.push_back(found->second);
    if (soup_->corners.size() % 3 == 0) soup_->sizes.push_back(3);
  }

 private:
  PolygonSoup* const soup_;
  absl::flat_hash_map<std::array<double, 3>, VertexIndex> vertices_;
};

constexpr std::size_t kStlHeaderBytes = 84;
constexpr std::size_t kStlTriangleBytes = 50;

std::uint32_t StlTriangles(absl::string_view bytes) {
  std::uint32_t triangles = 0;
  std::memcpy(&triangles, bytes.data() + kStlHeaderBytes - sizeof(triangles),
              sizeof(triangles));
  return triangles;
}

std::optional<MeshFault> ReadBinary(absl::string_view bytes,
                                    CornerJoiner* corners) {
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
      return MeshFault{absl::StrCat("triangle ", t, " (0-based)"),
                       absl::StrCat(kAxisNames[i % 3], " of corner ", i / 3 - 1,
                                    " (0-based) is ", numbers[i],
                                    ", expected a finite number")};
    }
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const float* const at = &numbers[3 + 3 * corner];
      corners->Add({at[0], at[1], at[2]});
    }
  }
  return std::nullopt;
}

std::optional<MeshFault> ReadText(absl::string_view text,
                                  CornerJoiner* joiner) {
  WordCursor cursor(text);
  std::int64_t triangles = 0;
  int corners = 0;
  bool has_ended = false;
  absl::string_view word;
  while (!(word = cursor.Take()).empty()) {
    // The name of a solid may have any words.
    const bool is_end = absl::EqualsIgnoreCase(word, "endsolid");
    if (is_end || absl::EqualsIgnoreCase(word, "solid")) {
      has_ended = is_end && corners == 0;
      cursor.TakeRestOfLine();
    }
    const bool ends_loop = absl::EqualsIgnoreCase(word, "endloop");
    if (ends_loop && corners != 3) {
      return MeshFault{cursor.Where(),
                       absl::StrCat("triangle ", triangles, " (0-based) has ",
                                    corners, " corners, expected 3")};
    }
    if (ends_loop) {
      corners = 0;
      ++triangles;
    }
    if (!absl::EqualsIgnoreCase(word, "vertex")) continue;
    ++corners;
    has_ended = false;
    std::array<double, 3> point = {};
    for (std::size_t axis = 0; axis < kAxisNames.size(); ++axis) {
      const absl::string_view number = cursor.Take();
      if (ReadFinite(number, &point[axis])) continue;
      return MeshFault{
          cursor.Where(),
          absl::StrCat(kAxisNames[axis], " of a corner of triangle ", triangles,
                       " (0-based) is ", Quoted(number),
                       ", expected a finite number")};
    }
    joiner->Add(point);
  }
  if (has_ended) return std::nullopt;
  return MeshFault{cursor.Where(),
                   absl::StrCat("the file ends after ", triangles,
                                " triangles without `endsolid`")};
}

}  // namespace

std::optional<MeshFault> ReadStlSoup(absl::string_view bytes,
                                     PolygonSoup* soup) {
  // Headers of binary files may begin with "solid" too; as a number, letters of
  // a text are more triangles than it has bytes for.
  const bool is_binary =
      bytes.size() >= kStlHeaderBytes &&
      kStlHeaderBytes + kStlTriangleBytes * std::size_t{StlTriangles(bytes)} <=
          bytes.size();
  absl::string_view text = bytes;
  absl::ConsumePrefix(&text, kByteOrderMark);
  const bool is_text =
      !is_binary && absl::StartsWithIgnoreCase(
                        absl::StripLeadingAsciiWhitespace(text), "solid");
  CornerJoiner joiner(soup);
  std::optional<MeshFault> fault =
      is_text ? ReadText(text, &joiner) : ReadBinary(bytes, &joiner);
  soup->format = "STL";
  soup->warnings.push_back(absl::StrCat(
      "STL has no vertices of its own: corners at one place were joined to ",
      soup->points.size(), " vertices, numbered in order of first use"));
  return fault;
}

}  // namespace isomatch
