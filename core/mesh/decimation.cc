#include "core/mesh/decimation.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include <meshoptimizer.h>

#include "absl/status/status.h"
#include "core/base/parallel.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

/// Of the mesh's extent: no limit, the count of vertices alone is one.
constexpr float kAnyError = 1e6f;

/// Of a closed surface.
constexpr double kFacesPerVertex = 2;

/// meshoptimizer cannot be stopped: of a mesh of more faces it gets patches at
/// first, which the processor's caches hold, and leaves of them so many faces
/// for each that is wanted in the end, but no smaller share of them in one
/// pass: where hardly more than the patches' borders is left, which stay, the
/// inside is too coarse to be mended. What the borders kept goes in later
/// passes, the last of them over all that is left.
constexpr std::size_t kFacesAtOnce = 1 << 17;
constexpr std::size_t kFacesOfPatch = 1 << 15;
constexpr double kFacesLeftOfPatches = 8;
constexpr double kLeastShareLeft = 0.125;

/// Vertices of faces, three each.
using FaceCorners = std::vector<unsigned int>;

using FloatPositions = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// meshoptimizer takes vertices at one place for one and does not collapse what
/// is no seam there. These are different vertices: they get places of their
/// own, a hair apart.
void SetApart(float hair, FloatPositions* positions) {
  std::vector<VertexIndex> order(positions->rows());
  std::iota(order.begin(), order.end(), 0);
  const auto place = [&](VertexIndex v) {
    return std::array<float, 3>{(*positions)(v, 0), (*positions)(v, 1),
                                (*positions)(v, 2)};
  };
  std::sort(order.begin(), order.end(), [&](VertexIndex a, VertexIndex b) {
    return std::pair(place(a), a) < std::pair(place(b), b);
  });
  std::vector<VertexIndex> same;
  for (std::size_t i = 1; i < order.size(); ++i) {
    if (place(order[i]) == place(order[i - 1])) same.push_back(order[i]);
  }
  for (std::size_t i = 0; i < same.size(); ++i) {
    constexpr std::size_t kSteps = 64;
    (*positions)(same[i], static_cast<Eigen::Index>(i % 3)) +=
        hair * static_cast<float>(1 + i % kSteps);
  }
}

/// About so many faces that are left of some.
FaceCorners Simplify(std::span<const unsigned int> corners,
                     const FloatPositions& positions, double wanted_faces,
                     unsigned int options) {
  if (corners.empty()) return {};
  // Time and memory go by the vertices that meshoptimizer is given: only these.
  const auto [first, last] = std::ranges::minmax(corners);
  std::vector<unsigned int> given_from_all(last - first + 1, 0);
  for (const unsigned int v : corners) given_from_all[v - first] = 1;
  std::vector<unsigned int> all_from_given;
  for (unsigned int v = first; v <= last; ++v) {
    if (given_from_all[v - first] == 0) continue;
    given_from_all[v - first] =
        static_cast<unsigned int>(all_from_given.size());
    all_from_given.push_back(v);
  }
  const FloatPositions given_positions = positions(all_from_given, Eigen::all);
  FaceCorners given(corners.begin(), corners.end());
  for (unsigned int& v : given) v = given_from_all[v - first];
  FaceCorners left(given.size());
  left.resize(meshopt_simplify(
      left.data(), given.data(), given.size(), given_positions.data(),
      given_positions.rows(), 3 * sizeof(float),
      3 * static_cast<std::size_t>(wanted_faces), kAnyError, options));
  for (unsigned int& v : left) v = all_from_given[v];
  return left;
}

/// The faces that are left of a large mesh once its patches are simplified each
/// for itself, their borders kept.
absl::StatusOr<FaceCorners> SimplifyPatches(const FaceCorners& corners,
                                            const FloatPositions& positions,
                                            double wanted_faces,
                                            const std::stop_token& stop) {
  const std::size_t faces = corners.size() / 3;
  const std::size_t count = faces / kFacesOfPatch;
  const double share = std::clamp(
      kFacesLeftOfPatches * wanted_faces / double(faces), kLeastShareLeft, 1.0);
  std::vector<FaceCorners> left(count);
  ISOMATCH_RETURN_IF_ERROR(
      ParallelFor(std::ssize(left), stop, [&](std::int64_t i) {
        const std::size_t begin = faces * i / count;
        const std::size_t end = faces * (i + 1) / count;
        left[i] = Simplify(
            std::span(corners).subspan(3 * begin, 3 * (end - begin)), positions,
            share * double(end - begin), meshopt_SimplifyLockBorder);
      }));
  FaceCorners all;
  for (const FaceCorners& patch : left) {
    all.insert(all.end(), patch.begin(), patch.end());
  }
  return all;
}

}  // namespace

absl::StatusOr<CoarseMesh> Decimate(const TriangleMesh& mesh,
                                    VertexIndex target,
                                    const std::stop_token& stop) {
  // meshoptimizer works in single precision: as near to the origin as can be.
  const Eigen::RowVector3d center = mesh.positions.colwise().mean();
  FloatPositions positions = (mesh.positions.rowwise() - center).cast<float>();
  SetApart(1e-6f * positions.cwiseAbs().maxCoeff(), &positions);
  FaceCorners left(mesh.faces.data(), mesh.faces.data() + mesh.faces.size());
  // A mesh with a boundary has fewer faces for its vertices.
  const double wanted_faces =
      target * std::min(kFacesPerVertex,
                        double{1} * mesh.num_faces() / mesh.num_vertices());
  for (bool shrinks = true; shrinks && left.size() / 3 > kFacesAtOnce;) {
    const std::size_t before = left.size();
    ISOMATCH_ASSIGN_OR_RETURN(
        left, SimplifyPatches(left, positions, wanted_faces, stop));
    shrinks = left.size() < before / 2;
  }
  ISOMATCH_RETURN_IF_ERROR(CheckNotCancelled(stop));
  left = Simplify(left, positions, wanted_faces, /*options=*/0);
  ISOMATCH_RETURN_IF_ERROR(CheckNotCancelled(stop));
  CoarseMesh coarse;
  VertexMap coarse_from_fine(mesh.num_vertices(), kNoVertex);
  for (const unsigned int v : left) coarse_from_fine[v] = 0;
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    if (coarse_from_fine[v] == kNoVertex) continue;
    coarse_from_fine[v] =
        static_cast<VertexIndex>(coarse.fine_from_coarse.size());
    coarse.fine_from_coarse.push_back(v);
  }
  coarse.mesh.positions = mesh.positions(coarse.fine_from_coarse, Eigen::all);
  coarse.mesh.faces.resize(static_cast<Eigen::Index>(left.size() / 3), 3);
  for (std::size_t i = 0; i < left.size(); ++i) {
    coarse.mesh.faces.data()[i] = coarse_from_fine[left[i]];
  }
  return coarse;
}

CoarseMesh Decimate(const TriangleMesh& mesh, VertexIndex target) {
  return *Decimate(mesh, target, {});
}

}  // namespace isomatch
