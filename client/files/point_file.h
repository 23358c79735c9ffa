#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "absl/types/span.h"

namespace isomatch {

/// A point in space that somebody set on a shape.
struct LandmarkPoint {
  /// Mesh units.
  Eigen::RowVector3d position;
  /// "" for none.
  std::string label;
};

/// What a file of points has.
struct PointFile {
  std::vector<LandmarkPoint> points;
  /// "LPS" or "RAS" where the file says so, else "".
  std::string space;
  /// Points that the file has not placed.
  int without_position = 0;
};

/// Whether the name is that of a file of points: .mrk.json, .json, .fcsv, .csv,
/// with .gz or without.
bool IsPointFile(const std::string& path);

/// Returns the points of a file, positions as it has them: of 3D Slicer
/// (.mrk.json, .fcsv), or lines `x y z [LABEL]`, which blanks or commas
/// separate. A first line without numbers names columns, x, y, z and label; #
/// starts a comment.
///
/// INVALID_ARGUMENT, naming file and line, byte or point, what was found and
/// what was expected: a coordinate that is no finite number, no points, no
/// markups; NOT_FOUND.
absl::StatusOr<PointFile> ReadPoints(const std::string& path);

/// Returns points as the bytes of a file that is to be at `path`: .json, .fcsv,
/// else lines `x,y,z,label`. `space` is what the file says of itself, LPS for
/// "".
std::string FormatPoints(const std::string& path, const std::string& space,
                         absl::Span<const LandmarkPoint> points);

}  // namespace isomatch
