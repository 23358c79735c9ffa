#include "client/files/vtk_reader.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "absl/algorithm/container.h"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "client/files/text_file.h"
#include "client/files/vtk_cells.h"
#include "client/files/word_cursor.h"

namespace isomatch {
namespace {

// Of VTK's cells.
constexpr int kTriangle = 5;
constexpr int kTriangleStrip = 6;
constexpr int kPolygon = 7;
constexpr int kQuad = 9;

VtkUse UseOfType(double type) {
  if (type == kTriangleStrip) return VtkUse::kStrip;
  const bool is_polygon =
      type == kTriangle || type == kPolygon || type == kQuad;
  return is_polygon ? VtkUse::kPolygon : VtkUse::kNone;
}

class VtkReader {
 public:
  VtkReader(absl::string_view bytes, PolygonSoup* soup)
      : bytes_(bytes), soup_(soup) {}

  std::optional<MeshFault> Read() {
    if (auto fault = ReadHeader()) return fault;
    while (!is_over_) {
      const absl::string_view keyword = Word();
      if (keyword.empty()) break;
      if (auto fault = ReadSection(absl::AsciiStrToUpper(keyword))) {
        return fault;
      }
    }
    if (has_cells_) {
      if (auto fault = AddVtkCells(cells_, uses_, 0, soup_)) return fault;
    }
    if (left_out_ > 0) {
      soup_->warnings.push_back(
          absl::StrCat(left_out_, " cells that are no polygons are left out"));
    }
    return std::nullopt;
  }

 private:
  std::optional<MeshFault> ReadHeader() {
    soup_->format = "VTK, ascii";
    if (!absl::StartsWith(bytes_, "# vtk DataFile")) {
      return Fault("expected `# vtk DataFile Version` at its beginning");
    }
    Line();
    Line();  // the title
    const std::string kind = absl::AsciiStrToUpper(Word());
    is_binary_ = kind == "BINARY";
    if (is_binary_) soup_->format = "VTK, binary";
    if (is_binary_ || kind == "ASCII") return std::nullopt;
    return Fault(
        absl::StrCat("found ", Quoted(kind), ", expected ASCII or BINARY"));
  }

  std::optional<MeshFault> ReadSection(const std::string& keyword) {
    if (keyword == "DATASET") return ReadDataset();
    if (keyword == "POINTS") return ReadPoints();
    if (keyword == "POLYGONS") return ReadPolygons({VtkUse::kPolygon});
    if (keyword == "TRIANGLE_STRIPS") return ReadPolygons({VtkUse::kStrip});
    if (keyword == "VERTICES" || keyword == "LINES") {
      return ReadPolygons({VtkUse::kNone});
    }
    if (keyword == "CELLS") return ReadGridCells();
    if (keyword == "CELL_TYPES") return ReadTypes();
    if (keyword == "FIELD") return SkipField();
    if (keyword == "METADATA") {  // up to an empty line
      Line();
      while (!Line().empty()) {
      }
      return std::nullopt;
    }
    if (keyword == "POINT_DATA" || keyword == "CELL_DATA") {
      is_over_ = true;
      return std::nullopt;
    }
    return Fault(absl::StrCat("found ", Quoted(keyword),
                              ", expected a section of a surface, as POINTS "
                              "and POLYGONS"));
  }

  std::optional<MeshFault> ReadDataset() {
    const std::string kind = absl::AsciiStrToUpper(Word());
    if (kind == "POLYDATA" || kind == "UNSTRUCTURED_GRID") return std::nullopt;
    return Fault(absl::StrCat("the dataset is ", Quoted(kind),
                              ", expected POLYDATA or UNSTRUCTURED_GRID"));
  }

  std::optional<MeshFault> ReadPoints() {
    std::int64_t count = 0;
    VtkNumberType type;
    if (auto fault = Count("points", &count)) return fault;
    if (auto fault = Type(&type)) return fault;
    std::vector<double> numbers;
    if (auto fault = Numbers(3 * count, type, &numbers)) return fault;
    if (!soup_->points.empty()) return Fault("expected POINTS once");
    return AddVtkPoints(numbers, soup_);
  }

  std::optional<MeshFault> ReadPolygons(const std::vector<VtkUse>& uses) {
    VtkCells cells;
    if (auto fault = ReadCells(&cells)) return fault;
    if (uses[0] == VtkUse::kNone) {
      left_out_ += static_cast<std::int64_t>(cells.ends.size());
    }
    return AddVtkCells(cells, uses, 0, soup_);
  }

  std::optional<MeshFault> ReadGridCells() {
    cells_ = {};
    return ReadCells(&cells_);
  }

  std::optional<MeshFault> ReadTypes() {
    std::int64_t count = 0;
    if (auto fault = Count("cell types", &count)) return fault;
    std::vector<double> types;
    if (auto fault = Numbers(count, {'i', 4}, &types)) return fault;
    if (types.size() != cells_.ends.size()) {
      return Fault(absl::StrCat(count, " cell types, expected ",
                                cells_.ends.size(), ", one for each cell"));
    }
    uses_.clear();
    for (const double type : types) uses_.push_back(UseOfType(type));
    left_out_ += absl::c_count(uses_, VtkUse::kNone);
    has_cells_ = !uses_.empty();
    return std::nullopt;
  }

  // Cells are COUNT and `n a b c ...` of each, or, since version 5, COUNT + 1
  // where they begin and end, and their vertices.
  std::optional<MeshFault> ReadCells(VtkCells* cells) {
    std::int64_t count = 0;
    std::int64_t size = 0;
    if (auto fault = Count("cells", &count)) return fault;
    if (auto fault = Count("numbers of cells", &size)) return fault;
    const std::size_t at = at_;
    const int line = line_;
    if (absl::AsciiStrToUpper(Word()) == "OFFSETS") {
      return ReadOffsets(count, size, cells);
    }
    at_ = at;
    line_ = line;
    std::vector<double> numbers;
    if (auto fault = Numbers(size, {'i', 4}, &numbers)) return fault;
    std::size_t i = 0;
    for (std::int64_t cell = 0; cell < count; ++cell) {
      const double corners = i < numbers.size() ? numbers[i] : -1;
      if (!(corners >= 0 &&
            corners < static_cast<double>(numbers.size() - i)) ||
          std::floor(corners) != corners) {
        return Fault(absl::StrCat("cell ", cell, " (0-based) has ", corners,
                                  " vertices, expected as many as its section "
                                  "has: ",
                                  size, " numbers for ", count, " cells"));
      }
      const auto first = numbers.begin() + static_cast<std::ptrdiff_t>(i) + 1;
      const auto length = static_cast<std::ptrdiff_t>(corners);
      cells->vertices.insert(cells->vertices.end(), first, first + length);
      cells->ends.push_back(static_cast<double>(cells->vertices.size()));
      i += static_cast<std::size_t>(corners) + 1;
    }
    return std::nullopt;
  }

  std::optional<MeshFault> ReadOffsets(std::int64_t offsets, std::int64_t size,
                                       VtkCells* cells) {
    VtkNumberType type;
    if (auto fault = Type(&type)) return fault;
    if (auto fault = Numbers(offsets, type, &cells->ends)) return fault;
    if (!cells->ends.empty()) cells->ends.erase(cells->ends.begin());
    if (const absl::string_view word = Word();
        absl::AsciiStrToUpper(word) != "CONNECTIVITY") {
      return Fault(
          absl::StrCat("found ", Quoted(word), ", expected CONNECTIVITY"));
    }
    if (auto fault = Type(&type)) return fault;
    return Numbers(size, type, &cells->vertices);
  }

  std::optional<MeshFault> SkipField() {
    Word();  // its name
    std::int64_t arrays = 0;
    if (auto fault = Count("arrays", &arrays)) return fault;
    for (std::int64_t i = 0; i < arrays; ++i) {
      std::int64_t components = 0;
      std::int64_t tuples = 0;
      if (Word().empty()) return Fault("the file ends in a FIELD");
      if (auto fault = Count("components", &components)) return fault;
      if (auto fault = Count("tuples", &tuples)) return fault;
      if (auto fault = SkipArray(components * tuples)) return fault;
    }
    return std::nullopt;
  }

  std::optional<MeshFault> SkipArray(std::int64_t count) {
    const std::size_t at = at_;
    const int line = line_;
    if (absl::AsciiStrToLower(Word()) == "string") return SkipTexts(count);
    at_ = at;
    line_ = line;
    VtkNumberType type;
    std::vector<double> ignored;
    if (auto fault = Type(&type)) return fault;
    return Numbers(count, type, &ignored);
  }

  // Texts are a line each or, in a binary file, follow their lengths.
  std::optional<MeshFault> SkipTexts(std::int64_t count) {
    Line();
    for (; count > 0; --count) {
      if (at_ == bytes_.size() || (is_binary_ && !SkipBinaryText())) {
        return Fault(absl::StrCat("the file ends, expected ", count,
                                  " texts more of an array of a FIELD"));
      }
      if (!is_binary_) Line();
    }
    return std::nullopt;
  }

  // The first two bits say how many bytes the length has, big endian: 8, 4, 2
  // or 1, of which they are the first. False when the file ends before.
  bool SkipBinaryText() {
    const auto first = static_cast<unsigned char>(bytes_[at_]);
    const std::size_t size = std::size_t{8} >> (first >> 6);
    if (bytes_.size() - at_ < size) return false;
    std::uint64_t length = first & 0x3f;
    for (std::size_t i = 1; i < size; ++i) {
      length = length << 8 | static_cast<unsigned char>(bytes_[at_ + i]);
    }
    at_ += size;
    if (bytes_.size() - at_ < length) return false;
    at_ += length;
    return true;
  }

  std::optional<MeshFault> Count(const char* of, std::int64_t* count) {
    const auto found = ParseHeaderCount(Word(), of);
    if (!found.ok()) return Fault(std::string(found.status().message()));
    *count = *found;
    return std::nullopt;
  }

  std::optional<MeshFault> Type(VtkNumberType* type) {
    const absl::string_view word = Word();
    const auto found = VtkTypeOf(word);
    if (!found) {
      return Fault(absl::StrCat("the type of numbers is ", Quoted(word),
                                ", expected e.g. float, double or int"));
    }
    *type = *found;
    return std::nullopt;
  }

  // Takes numbers, which in a binary file follow the line's end.
  std::optional<MeshFault> Numbers(std::int64_t count, VtkNumberType type,
                                   std::vector<double>* numbers) {
    if (is_binary_) Line();
    const std::size_t shortest = is_binary_ ? type.bytes : 1;
    const std::size_t left = bytes_.size() - at_;
    // An ascii number is followed by a blank, but for the last.
    const std::size_t most = is_binary_ ? left / shortest : left / 2 + 1;
    if (static_cast<std::size_t>(count) > most) {
      return Fault(absl::StrCat("the header claims ", count,
                                " numbers, but the file has ", left,
                                " bytes more"));
    }
    if (is_binary_) {
      const std::size_t size = static_cast<std::size_t>(count) * type.bytes;
      *numbers = VtkNumbers(bytes_.substr(at_, size), type,
                            /*is_big_endian=*/true);
      at_ += size;
      return std::nullopt;
    }
    numbers->resize(static_cast<std::size_t>(count));
    for (double& number : *numbers) {
      const absl::string_view word = Word();
      if (ReadFinite(word, &number)) continue;
      return Fault(
          absl::StrCat("found ", Quoted(word), ", expected a finite number"));
    }
    return std::nullopt;
  }

  // The next word; "" at the end.
  absl::string_view Word() {
    while (at_ < bytes_.size() &&
           absl::ascii_isspace(static_cast<unsigned char>(bytes_[at_]))) {
      line_ += bytes_[at_++] == '\n' ? 1 : 0;
    }
    const std::size_t begin = at_;
    while (at_ < bytes_.size() &&
           !absl::ascii_isspace(static_cast<unsigned char>(bytes_[at_]))) {
      ++at_;
    }
    return bytes_.substr(begin, at_ - begin);
  }

  // What is left of the line.
  absl::string_view Line() {
    const std::size_t begin = at_;
    const std::size_t end = std::min(bytes_.find('\n', at_), bytes_.size());
    at_ = std::min(end + 1, bytes_.size());
    ++line_;
    return absl::StripAsciiWhitespace(bytes_.substr(begin, end - begin));
  }

  MeshFault Fault(std::string what) const {
    return {
        is_binary_ ? absl::StrCat("byte ", at_) : absl::StrCat("line ", line_),
        std::move(what)};
  }

  const absl::string_view bytes_;
  PolygonSoup* const soup_;
  std::size_t at_ = 0;
  int line_ = 1;
  bool is_binary_ = false;
  bool is_over_ = false;
  /// Of an UNSTRUCTURED_GRID.
  VtkCells cells_;
  std::vector<VtkUse> uses_;
  bool has_cells_ = false;
  std::int64_t left_out_ = 0;
};

}  // namespace

std::optional<MeshFault> ReadVtkSoup(absl::string_view bytes,
                                     PolygonSoup* soup) {
  return VtkReader(bytes, soup).Read();
}

}  // namespace isomatch
