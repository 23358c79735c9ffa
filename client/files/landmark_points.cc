#include "client/files/landmark_points.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <utility>

#include <Eigen/Geometry>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/base/status_macros.h"
#include "core/mesh/mesh_geometry.h"

namespace isomatch {
namespace {

// As fractions of the bounding box's diagonal. A point that was set by hand on
// the same mesh is nearer than the first; one in another coordinate system or
// unit is mostly farther than the second.
constexpr double kFar = 0.01;
constexpr double kAbsurd = 0.2;
// How much nearer the other coordinate system has to bring the points.
constexpr double kMuchNearer = 4;

double SquaredDistance(const TriangleMesh& mesh, VertexIndex v,
                       const Eigen::RowVector3d& position) {
  return (mesh.positions.row(v) - position).squaredNorm();
}

// The faces that may have the nearest point of the surface: their box is no
// farther than the nearest corner of any face.
std::vector<VertexIndex> NearFaces(const TriangleMesh& mesh,
                                   const Eigen::RowVector3d& position) {
  double least = std::numeric_limits<double>::infinity();
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    for (int i = 0; i < 3; ++i) {
      least =
          std::min(least, SquaredDistance(mesh, mesh.faces(f, i), position));
    }
  }
  std::vector<VertexIndex> near;
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    Eigen::AlignedBox3d box;
    for (int i = 0; i < 3; ++i) {
      box.extend(mesh.positions.row(mesh.faces(f, i)).transpose());
    }
    if (box.squaredExteriorDistance(position.transpose()) <= least) {
      near.push_back(f);
    }
  }
  return near;
}

SnappedPoint Snap(const TriangleMesh& mesh, const LandmarkPoint& point) {
  SnappedPoint snapped;
  snapped.label = point.label;
  snapped.place =
      NearestOnFaces(mesh, NearFaces(mesh, point.position), point.position);
  snapped.distance = (PositionOf(mesh, snapped.place) - point.position).norm();
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 3; ++i) {
    const VertexIndex v = mesh.faces(snapped.place.face, i);
    const double squared = SquaredDistance(mesh, v, point.position);
    if (squared >= least) continue;
    least = squared;
    snapped.vertex = v;
  }
  snapped.vertex_distance = std::sqrt(least);
  return snapped;
}

std::vector<SnappedPoint> SnapAll(const TriangleMesh& mesh,
                                  const std::vector<LandmarkPoint>& points) {
  std::vector<SnappedPoint> snapped;
  snapped.reserve(points.size());
  for (const LandmarkPoint& point : points) {
    snapped.push_back(Snap(mesh, point));
  }
  return snapped;
}

double MeanDistance(const std::vector<SnappedPoint>& points) {
  double sum = 0;
  for (const SnappedPoint& point : points) sum += point.distance;
  return sum / static_cast<double>(points.size());
}

// "nose" or "point 3 (1-based)".
std::string NameOf(const std::vector<SnappedPoint>& points, std::size_t i) {
  return points[i].label.empty() ? absl::StrCat("point ", i + 1, " (1-based)")
                                 : absl::StrCat("'", points[i].label, "'");
}

std::vector<LandmarkPoint> Negated(std::vector<LandmarkPoint> points) {
  for (LandmarkPoint& point : points) point.position.head<2>() *= -1;
  return points;
}

// The points in the other coordinate system, where they are meant so.
void TryOtherSpace(const PointFile& file, const TriangleMesh& mesh,
                   double diagonal, const std::string& subject,
                   SnappedPoints* snapped) {
  const double as_is = MeanDistance(snapped->points);
  if (file.space.empty() || as_is <= kFar * diagonal) return;
  std::vector<SnappedPoint> other = SnapAll(mesh, Negated(file.points));
  const double negated = MeanDistance(other);
  if (kMuchNearer * negated > as_is) return;
  snapped->points = std::move(other);
  snapped->space = file.space == "LPS" ? "RAS" : "LPS";
  snapped->warnings.push_back(absl::StrFormat(
      "%s: the file is in %s, the mesh in %s: x and y are negated, so that the "
      "points lie %.4g from the surface on average, not %.4g",
      subject, file.space, snapped->space, negated, as_is));
}

absl::Status CheckDistances(const std::string& subject, double diagonal,
                            SnappedPoints* snapped) {
  std::vector<std::string> far;
  for (std::size_t i = 0; i < snapped->points.size(); ++i) {
    const double distance = snapped->points[i].distance;
    if (distance > kAbsurd * diagonal) {
      return absl::InvalidArgumentError(absl::StrFormat(
          "%s: %s is %.4g from the surface, %.0f %% of the diagonal of its "
          "bounding box, expected less than %.0f %%: the points are in another "
          "coordinate system or unit than the mesh",
          subject, NameOf(snapped->points, i), distance,
          100 * distance / diagonal, 100 * kAbsurd));
    }
    if (distance > kFar * diagonal) {
      far.push_back(
          absl::StrFormat("%s %.4g", NameOf(snapped->points, i), distance));
    }
  }
  if (far.empty()) return absl::OkStatus();
  snapped->warnings.push_back(absl::StrFormat(
      "%s: %d points are farther from the surface than %.0f %% of the diagonal "
      "of its bounding box: %s",
      subject, far.size(), 100 * kFar, absl::StrJoin(far, ", ")));
  return absl::OkStatus();
}

std::string Summary(const std::string& name,
                    const std::vector<SnappedPoint>& points, double diagonal) {
  std::size_t farthest = 0;
  double to_vertex = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (points[i].distance > points[farthest].distance) farthest = i;
    to_vertex = std::max(to_vertex, points[i].vertex_distance);
  }
  const double mean = MeanDistance(points);
  const double largest = points[farthest].distance;
  return absl::StrFormat(
      "landmarks on %s: %d points, %.4g from the surface on average (%.2g %% "
      "of the diagonal), %s the farthest with %.4g (%.2g %%); to their "
      "vertices at most %.4g",
      name, points.size(), mean, 100 * mean / diagonal,
      NameOf(points, farthest), largest, 100 * largest / diagonal, to_vertex);
}

// Points by label; empty unless all have one and none is there twice.
std::map<std::string, std::size_t> ByLabel(
    const std::vector<SnappedPoint>& points) {
  std::map<std::string, std::size_t> numbers;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (points[i].label.empty() ||
        !numbers.emplace(points[i].label, i).second) {
      return {};
    }
  }
  return numbers;
}

// Labels of `from` that `in` does not have, in order.
std::vector<std::string> Missing(const std::vector<SnappedPoint>& from,
                                 const std::map<std::string, std::size_t>& in) {
  std::vector<std::string> labels;
  for (const SnappedPoint& point : from) {
    if (in.count(point.label) == 0) labels.push_back(point.label);
  }
  return labels;
}

using Numbers = std::vector<std::pair<std::size_t, std::size_t>>;

Numbers PairByLabel(const SnappedPoints& x, const SnappedPoints& y,
                    const std::string& files,
                    std::vector<std::string>* warnings) {
  const auto labels_x = ByLabel(x.points);
  const auto labels_y = ByLabel(y.points);
  Numbers pairs;
  for (std::size_t i = 0; i < x.points.size() && !labels_x.empty(); ++i) {
    const auto found = labels_y.find(x.points[i].label);
    if (found != labels_y.end()) pairs.emplace_back(i, found->second);
  }
  if (pairs.empty()) return pairs;
  const std::vector<std::string> only_x = Missing(x.points, labels_y);
  const std::vector<std::string> only_y = Missing(y.points, labels_x);
  if (!only_x.empty() || !only_y.empty()) {
    warnings->push_back(absl::StrCat(
        files, ": points whose label is in one file only are left out: ",
        absl::StrJoin(only_x, ", "),
        !only_x.empty() && !only_y.empty() ? "; " : "",
        absl::StrJoin(only_y, ", ")));
  }
  return pairs;
}

// One partner for each vertex.
absl::Status CheckPartners(const SnappedPoints& x, const SnappedPoints& y,
                           const Numbers& pairs, const std::string& files) {
  for (const bool of_x : {true, false}) {
    const auto& from = of_x ? x.points : y.points;
    const auto& to = of_x ? y.points : x.points;
    std::map<VertexIndex, std::pair<std::size_t, std::size_t>> partners;
    for (const auto& [i, j] : pairs) {
      const std::size_t here = of_x ? i : j;
      const std::size_t there = of_x ? j : i;
      const auto [entry, is_new] =
          partners.emplace(from[here].vertex, std::pair(here, there));
      if (is_new || to[entry->second.second].vertex == to[there].vertex) {
        continue;
      }
      return absl::InvalidArgumentError(absl::StrCat(
          files, ": ", NameOf(from, entry->second.first), " and ",
          NameOf(from, here), " of ", of_x ? "X" : "Y",
          " are both nearest to vertex ", from[here].vertex,
          ", expected points at different vertices, or a finer mesh"));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<SnappedPoints> ReadSnappedPoints(const std::string& path,
                                                const TriangleMesh& mesh,
                                                const std::string& name) {
  ISOMATCH_ASSIGN_OR_RETURN(const PointFile file, ReadPoints(path));
  const std::string subject = absl::StrCat("'", path, "' on ", name);
  if (mesh.num_faces() == 0) {
    return absl::InvalidArgumentError(
        absl::StrCat(subject, ": the mesh has no face, expected a surface"));
  }
  const double diagonal = BoxOfFaces(mesh).sizes().norm();
  SnappedPoints snapped;
  snapped.space = file.space;
  snapped.points = SnapAll(mesh, file.points);
  TryOtherSpace(file, mesh, diagonal, subject, &snapped);
  if (file.without_position > 0) {
    snapped.warnings.push_back(
        absl::StrCat(subject, ": ", file.without_position,
                     " points have no position and are left out"));
  }
  ISOMATCH_RETURN_IF_ERROR(CheckDistances(subject, diagonal, &snapped));
  snapped.summary = Summary(name, snapped.points, diagonal);
  return snapped;
}

absl::StatusOr<std::vector<VertexMatch>> PairPoints(
    const SnappedPoints& x, const SnappedPoints& y, const std::string& files,
    std::vector<std::string>* warnings) {
  Numbers pairs = PairByLabel(x, y, files, warnings);
  if (pairs.empty()) {
    if (x.points.size() != y.points.size()) {
      return absl::InvalidArgumentError(absl::StrCat(
          files, ": ", x.points.size(), " points of X and ", y.points.size(),
          " of Y without labels in common, expected as many of both"));
    }
    if (!ByLabel(x.points).empty() && !ByLabel(y.points).empty()) {
      warnings->push_back(absl::StrCat(
          files, ": no label is in both files: points are paired by order"));
    }
    for (std::size_t i = 0; i < x.points.size(); ++i) pairs.emplace_back(i, i);
  }
  ISOMATCH_RETURN_IF_ERROR(CheckPartners(x, y, pairs, files));
  std::vector<VertexMatch> matches;
  matches.reserve(pairs.size());
  for (const auto& [i, j] : pairs) {
    matches.push_back({x.points[i].vertex, y.points[j].vertex});
  }
  return matches;
}

}  // namespace isomatch
