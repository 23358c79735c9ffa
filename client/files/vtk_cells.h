#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/string_view.h"
#include "client/files/polygon_soup.h"

namespace isomatch {

/// A type of numbers in VTK files.
struct VtkNumberType {
  char kind = 'f';  ///< f float, i signed, u unsigned
  std::size_t bytes = 4;
};

/// The type that a legacy file calls e.g. "unsigned_int", an XML file "UInt32".
std::optional<VtkNumberType> VtkTypeOf(absl::string_view name);

/// Returns the numbers that `bytes` are. REQUIRES: their size is a multiple of
/// the type's.
std::vector<double> VtkNumbers(absl::string_view bytes, VtkNumberType type,
                               bool is_big_endian);

/// Cells of one kind: the vertices of all, one after another, and where those
/// of each end.
struct VtkCells {
  std::vector<double> vertices;
  std::vector<double> ends;
};

/// What is made of a cell.
enum class VtkUse { kPolygon, kStrip, kNone };

/// Takes the three coordinates of each point; returns the first that is not
/// finite.
std::optional<MeshFault> AddVtkPoints(const std::vector<double>& numbers,
                                      PolygonSoup* soup);

/// Appends polygons, and strips as triangles, to `soup`, whose points from
/// `first_point` on the cells number from 0. `uses` has what to do with each
/// cell, or one for all. Returns the first cell that ends before it begins,
/// names no vertex, or has fewer than three.
std::optional<MeshFault> AddVtkCells(const VtkCells& cells,
                                     const std::vector<VtkUse>& uses,
                                     std::size_t first_point,
                                     PolygonSoup* soup);

}  // namespace isomatch
