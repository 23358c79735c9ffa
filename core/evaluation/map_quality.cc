#include "core/evaluation/map_quality.h"

#include <algorithm>
#include <cmath>

#include "core/base/parallel.h"
#include "core/base/status_macros.h"
#include "core/geodesic/distance_field_solver.h"
#include "core/mesh/mesh_geometry.h"

namespace isomatch {
namespace {

constexpr int kAnchors = 24;
constexpr double kReachInEdges = 2;
constexpr double kLargestAreaRatio = 1000;

/// The largest distance there is; what is out of reach is taken to lie there.
float LargestReached(const BasisPoints& basis, int count) {
  float largest = 0;
  for (VertexIndex v = 0; v < basis.num_vertices(); ++v) {
    for (int z = 0; z < count; ++z) {
      const float distance = basis.Distance(v, z);
      if (distance < kUnreachable) largest = std::max(largest, distance);
    }
  }
  return largest;
}

absl::Status MeasureDistances(const BasisPoints& basis_x,
                              const DistanceFieldSolver& solver_y,
                              const MeasuredMap& map,
                              const std::stop_token& stop,
                              MapMeasures* measures) {
  const int most = std::min(kAnchors, basis_x.num_points());
  std::vector<int> anchors;
  std::vector<VertexIndex> images;
  for (int a = 0; a < most; ++a) {
    const VertexIndex anchor = basis_x.points()[a];
    if (!map.Has(anchor)) continue;
    anchors.push_back(a);
    images.push_back(map.y_from_x[anchor]);
  }
  ISOMATCH_ASSIGN_OR_RETURN(
      const BasisPoints basis_y,
      BasisPoints::Create(solver_y, images, nullptr, stop));
  const float largest_x = LargestReached(basis_x, most);
  const float largest_y = LargestReached(basis_y, basis_y.num_points());
  measures->distortions.assign(map.y_from_x.size(), -1);
  double sum = 0;
  std::int64_t count = 0;
  std::vector<float> differences(anchors.size());
  for (std::size_t x = 0; x < map.y_from_x.size() && !anchors.empty(); ++x) {
    const auto vertex = static_cast<VertexIndex>(x);
    if (!map.Has(vertex)) continue;
    const float* const on_x = basis_x.Profile(vertex);
    const float* const on_y = basis_y.Profile(map.y_from_x[x]);
    for (std::size_t a = 0; a < anchors.size(); ++a) {
      differences[a] = std::abs(std::min(on_x[anchors[a]], largest_x) -
                                std::min(on_y[a], largest_y));
      sum += differences[a];
    }
    count += static_cast<std::int64_t>(anchors.size());
    const auto middle = differences.begin() + differences.size() / 2;
    std::nth_element(differences.begin(), middle, differences.end());
    measures->distortions[x] = *middle;
  }
  measures->geodesic_distortion =
      count > 0 ? sum / static_cast<double>(count) : 0;
  return absl::OkStatus();
}

double Coverage(const DistanceFieldSolver& solver_y, const TriangleMesh& mesh_y,
                const MeasuredMap& map, float reach) {
  // Fronts go no further than the reach, and each image is one source.
  std::vector<float> nearest(mesh_y.num_vertices(), reach);
  std::vector<char> is_image(mesh_y.num_vertices(), false);
  DistanceFieldSolver::Workspace workspace;
  for (std::size_t x = 0; x < map.y_from_x.size(); ++x) {
    const VertexIndex y = map.y_from_x[x];
    if (!map.Has(static_cast<VertexIndex>(x)) || is_image[y]) continue;
    is_image[y] = true;
    solver_y.Lower(y, absl::MakeSpan(nearest), &workspace);
  }
  double covered = 0;
  double total = 0;
  for (VertexIndex f = 0; f < mesh_y.num_faces(); ++f) {
    const double third = FaceArea(mesh_y, f) / 3;
    for (int corner = 0; corner < 3; ++corner) {
      total += third;
      if (nearest[mesh_y.faces(f, corner)] < reach) covered += third;
    }
  }
  return covered / total;
}

double AreaDistortion(const TriangleMesh& mesh_x, const MeasuredMap& map) {
  const TriangleMesh mapped = {map.images, mesh_x.faces};
  double sum = 0;
  double total = 0;
  for (VertexIndex f = 0; f < mesh_x.num_faces(); ++f) {
    const double area = FaceArea(mesh_x, f);
    const bool counts = map.Has(mesh_x.faces(f, 0)) &&
                        map.Has(mesh_x.faces(f, 1)) &&
                        map.Has(mesh_x.faces(f, 2));
    if (!(area > 0) || !counts) continue;
    const double ratio = std::clamp(FaceArea(mapped, f) / area,
                                    1 / kLargestAreaRatio, kLargestAreaRatio);
    sum += area * std::abs(std::log(ratio));
    total += area;
  }
  return total > 0 ? sum / total : 0;
}

}  // namespace

absl::StatusOr<MapMeasures> MeasureMap(const TriangleMesh& mesh_x,
                                       const BasisPoints& basis_x,
                                       const TriangleMesh& mesh_y,
                                       const MeasuredMap& map,
                                       const std::stop_token& stop) {
  const DistanceFieldSolver solver_y(mesh_y, stop);
  MapMeasures measures;
  const double edge = std::max(MeanEdgeLength(mesh_x), MeanEdgeLength(mesh_y));
  ISOMATCH_RETURN_IF_ERROR(RunBoth(
      [&] { return MeasureDistances(basis_x, solver_y, map, stop, &measures); },
      [&] {
        measures.coverage = Coverage(solver_y, mesh_y, map,
                                     static_cast<float>(kReachInEdges * edge));
        measures.area_distortion = AreaDistortion(mesh_x, map);
        return CheckNotCancelled(stop);
      }));
  return measures;
}

}  // namespace isomatch
