#include "client/files/vtk_cells.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"

namespace isomatch {
namespace {

template <typename T>
double NumberOf(const char* bytes) {
  T number;
  std::memcpy(&number, bytes, sizeof(number));
  return static_cast<double>(number);
}

double NumberOf(const char* bytes, VtkNumberType type) {
  switch (type.bytes) {
    case 1:
      return type.kind == 'i' ? NumberOf<std::int8_t>(bytes)
                              : NumberOf<std::uint8_t>(bytes);
    case 2:
      return type.kind == 'i' ? NumberOf<std::int16_t>(bytes)
                              : NumberOf<std::uint16_t>(bytes);
    case 4:
      if (type.kind == 'f') return NumberOf<float>(bytes);
      return type.kind == 'i' ? NumberOf<std::int32_t>(bytes)
                              : NumberOf<std::uint32_t>(bytes);
    default:
      if (type.kind == 'f') return NumberOf<double>(bytes);
      return type.kind == 'i' ? NumberOf<std::int64_t>(bytes)
                              : NumberOf<std::uint64_t>(bytes);
  }
}

void AddPolygon(const std::vector<VertexIndex>& corners, PolygonSoup* soup) {
  soup->corners.insert(soup->corners.end(), corners.begin(), corners.end());
  soup->sizes.push_back(static_cast<VertexIndex>(corners.size()));
}

void AddStrip(const std::vector<VertexIndex>& corners, PolygonSoup* soup) {
  for (std::size_t i = 0; i + 2 < corners.size(); ++i) {
    std::vector<VertexIndex> triangle(corners.begin() + i,
                                      corners.begin() + i + 3);
    if (i % 2 == 1) std::swap(triangle[1], triangle[2]);
    AddPolygon(triangle, soup);
  }
}

MeshFault CellFault(std::size_t cell, const std::string& what) {
  return {absl::StrCat("cell ", cell, " (0-based)"), what};
}

// Checks that each cell begins where the one before it ends.
std::optional<MeshFault> CheckEnds(const VtkCells& cells) {
  const auto most = static_cast<double>(cells.vertices.size());
  double begin = 0;
  for (std::size_t cell = 0; cell < cells.ends.size(); ++cell) {
    const double end = cells.ends[cell];
    if (!(begin <= end && end <= most) || std::floor(end) != end) {
      return CellFault(
          cell, absl::StrCat("its vertices are those from ", begin,
                             " to below ", end, ", expected some of ", most));
    }
    begin = end;
  }
  return std::nullopt;
}

// The vertices of cell `cell`, numbered as the soup does.
std::optional<MeshFault> TakeCorners(const VtkCells& cells, std::size_t cell,
                                     std::size_t first_point,
                                     std::size_t points,
                                     std::vector<VertexIndex>* corners) {
  const double begin = cell == 0 ? 0 : cells.ends[cell - 1];
  const double end = cells.ends[cell];
  if (end - begin < 3) {
    return CellFault(cell, absl::StrCat("it has ", end - begin,
                                        " vertices, expected 3 or more"));
  }
  corners->clear();
  for (auto i = static_cast<std::size_t>(begin);
       i < static_cast<std::size_t>(end); ++i) {
    const double v = cells.vertices[i];
    if (!(v >= 0 && v < static_cast<double>(points)) || std::floor(v) != v) {
      return CellFault(cell, absl::StrCat("it names vertex ", v,
                                          ", expected 0 to ", points, " - 1"));
    }
    corners->push_back(
        static_cast<VertexIndex>(first_point + static_cast<std::size_t>(v)));
  }
  return std::nullopt;
}

}  // namespace

std::optional<VtkNumberType> VtkTypeOf(absl::string_view name) {
  struct Named {
    const char* name;
    VtkNumberType type;
  };
  static constexpr std::array<Named, 24> kTypes = {
      {{"float", {'f', 4}},        {"double", {'f', 8}},
       {"char", {'i', 1}},         {"unsigned_char", {'u', 1}},
       {"short", {'i', 2}},        {"unsigned_short", {'u', 2}},
       {"int", {'i', 4}},          {"unsigned_int", {'u', 4}},
       {"long", {'i', 8}},         {"unsigned_long", {'u', 8}},
       {"vtkidtype", {'i', 4}},    {"vtktypeint32", {'i', 4}},
       {"vtktypeint64", {'i', 8}}, {"vtktypeuint64", {'u', 8}},
       {"float32", {'f', 4}},      {"float64", {'f', 8}},
       {"int8", {'i', 1}},         {"uint8", {'u', 1}},
       {"int16", {'i', 2}},        {"uint16", {'u', 2}},
       {"int32", {'i', 4}},        {"uint32", {'u', 4}},
       {"int64", {'i', 8}},        {"uint64", {'u', 8}}}};
  const std::string lower = absl::AsciiStrToLower(name);
  const auto* const found =
      std::find_if(kTypes.begin(), kTypes.end(),
                   [&](const Named& known) { return lower == known.name; });
  if (found == kTypes.end()) return std::nullopt;
  return found->type;
}

std::vector<double> VtkNumbers(absl::string_view bytes, VtkNumberType type,
                               bool is_big_endian) {
  std::vector<double> numbers;
  numbers.reserve(bytes.size() / type.bytes);
  std::array<char, 8> number = {};
  for (std::size_t at = 0; at < bytes.size(); at += type.bytes) {
    for (std::size_t i = 0; i < type.bytes; ++i) {
      number[is_big_endian ? type.bytes - 1 - i : i] = bytes[at + i];
    }
    numbers.push_back(NumberOf(number.data(), type));
  }
  return numbers;
}

std::optional<MeshFault> AddVtkPoints(const std::vector<double>& numbers,
                                      PolygonSoup* soup) {
  for (std::size_t i = 0; i + 2 < numbers.size(); i += 3) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (std::isfinite(numbers[i + axis])) continue;
      return MeshFault{absl::StrCat("point ", i / 3, " (0-based)"),
                       absl::StrCat(kAxisNames[axis], " is ", numbers[i + axis],
                                    ", expected a finite number")};
    }
    soup->points.push_back({numbers[i], numbers[i + 1], numbers[i + 2]});
  }
  return std::nullopt;
}

std::optional<MeshFault> AddVtkCells(const VtkCells& cells,
                                     const std::vector<VtkUse>& uses,
                                     std::size_t first_point,
                                     PolygonSoup* soup) {
  const std::size_t points = soup->points.size() - first_point;
  if (auto fault = CheckEnds(cells)) return fault;
  std::vector<VertexIndex> corners;
  for (std::size_t cell = 0; cell < cells.ends.size(); ++cell) {
    const VtkUse use = uses[std::min(cell, uses.size() - 1)];
    if (use == VtkUse::kNone) continue;
    if (auto fault = TakeCorners(cells, cell, first_point, points, &corners)) {
      return fault;
    }
    use == VtkUse::kStrip ? AddStrip(corners, soup) : AddPolygon(corners, soup);
  }
  return std::nullopt;
}

}  // namespace isomatch
