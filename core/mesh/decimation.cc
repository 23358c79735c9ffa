#include "core/mesh/decimation.h"

#include <algorithm>
#include <array>
#include <cmath>
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
#include "core/mesh/rim_walker.h"

namespace isomatch {
namespace {

/// Largest error of a collapse, as a fraction of the mesh's extent. It is no
/// limit: only the count of vertices ends a decimation.
constexpr float kAnyError = 1e6f;

/// Faces for each vertex of a closed surface.
constexpr double kFacesPerVertex = 2;

/// meshoptimizer cannot be stopped: a mesh of more faces than this is decimated
/// patch by patch, in one pass or several. What is left is decimated as a
/// whole, which also thins the borders that the patches kept.
constexpr std::size_t kFacesAtOnce = 1 << 17;
/// Faces of a patch: few enough for the processor's caches.
constexpr std::size_t kFacesOfPatch = 1 << 15;
/// Faces that patches leave for each one that is wanted in the end.
constexpr double kFacesLeftOfPatches = 8;
/// The least share of its faces that one pass leaves of a patch. Its border
/// stays: if hardly more than that were left, the inside would be too coarse to
/// be mended.
constexpr double kLeastShareLeft = 0.125;

/// Where more than this many times what was asked for is left, a mended mesh is
/// decimated: without holes of as many edges as this on the decimated one.
constexpr double kWell = 1.2;
constexpr double kClosedRim = 4;

/// Vertices of faces, three each.
using FaceCorners = std::vector<unsigned int>;

using FloatPositions = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// meshoptimizer takes vertices at the same place for one vertex, and collapses
/// no edges there that are not on a seam. Here they are different vertices, so
/// each gets a place of its own, a hair apart.
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

/// Simplifies the faces of `corners` to about `wanted_faces`.
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

/// Returns the faces that are left of a large mesh when each of its patches is
/// simplified by itself, with its border kept.
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

absl::StatusOr<FaceCorners> SimplifyAll(FaceCorners left,
                                        const FloatPositions& positions,
                                        double wanted_faces,
                                        const std::stop_token& stop) {
  for (bool shrinks = true; shrinks && left.size() / 3 > kFacesAtOnce;) {
    const std::size_t before = left.size();
    ISOMATCH_ASSIGN_OR_RETURN(
        left, SimplifyPatches(left, positions, wanted_faces, stop));
    shrinks = left.size() < before / 2;
  }
  ISOMATCH_RETURN_IF_ERROR(CheckNotCancelled(stop));
  left = Simplify(left, positions, wanted_faces, /*options=*/0);
  ISOMATCH_RETURN_IF_ERROR(CheckNotCancelled(stop));
  return left;
}

/// Whether the face stands on an edge of three faces or more and meets nothing
/// else.
bool IsFin(const EdgeFaces& edges, VertexIndex face) {
  int rim_sides = 0;
  int manifold_sides = 0;
  for (int corner = 0; corner < 3; ++corner) {
    rim_sides += edges.IsBoundary(face, corner);
    manifold_sides += edges.Opposite(face, corner).face != kNoVertex;
  }
  return rim_sides == 2 && manifold_sides == 0;
}

/// The faces of `mesh` but for fins, and more that close its holes of at most
/// `most_edges` edges, each after a face at its rim.
FaceCorners Mended(const TriangleMesh& mesh, double most_edges) {
  const EdgeFaces edges(mesh.faces);
  RimWalker rims(edges, mesh.faces);
  FaceCorners corners;
  corners.reserve(mesh.faces.size());
  const auto add = [&](VertexIndex a, VertexIndex b, VertexIndex c) {
    for (const VertexIndex v : {a, b, c}) {
      corners.push_back(static_cast<unsigned int>(v));
    }
  };
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    if (IsFin(edges, f)) continue;
    add(mesh.faces(f, 0), mesh.faces(f, 1), mesh.faces(f, 2));
    for (int corner = 0; corner < 3; ++corner) {
      const auto rim = rims.Walk({f, corner});
      if (!rims.is_closed() || static_cast<double>(rim.size()) > most_edges) {
        continue;
      }
      for (std::size_t i = 2; i < rim.size(); ++i) {
        add(rim[0], rim[i], rim[i - 1]);
      }
    }
  }
  return corners;
}

std::int64_t CountVertices(FaceCorners corners) {
  std::sort(corners.begin(), corners.end());
  return std::unique(corners.begin(), corners.end()) - corners.begin();
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
  ISOMATCH_ASSIGN_OR_RETURN(
      left, SimplifyAll(std::move(left), positions, wanted_faces, stop));
  if (CountVertices(left) > kWell * target) {
    // Each hole keeps three vertices at least, each fin two.
    const double fineness = std::sqrt(double{1} * mesh.num_vertices() / target);
    ISOMATCH_ASSIGN_OR_RETURN(
        FaceCorners left_of_mended,
        SimplifyAll(Mended(mesh, kClosedRim * fineness), positions,
                    kFacesPerVertex * target, stop));
    // All faces may be fins, as the pages of a book are.
    if (left_of_mended.size() < left.size() &&
        CountVertices(left_of_mended) >= target / kWell) {
      left = std::move(left_of_mended);
    }
  }
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

}  // namespace isomatch
