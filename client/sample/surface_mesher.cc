#include "client/sample/surface_mesher.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <stop_token>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "client/sample/editable_mesh.h"
#include "client/sample/marching_tetrahedra.h"
#include "core/base/parallel.h"

namespace isomatch {
namespace {

using Eigen::Vector3d;

// Edge of the first grid: below the thinnest part's radius, 0.022.
constexpr double kFirstStep = 0.02;

// Edges are kept between these multiples of the wanted length (Botsch and
// Kobbelt, A remeshing approach to multiresolution modeling, SGP 2004).
constexpr double kLongest = 4.0 / 3;
constexpr double kShortest = 4.0 / 5;

// Rounds at the wanted length; beyond, triangles hardly get better.
constexpr int kFinalRounds = 4;

// Vertices that are moved by one task.
constexpr int kBlock = 4096;

double Squared(double x) { return x * x; }

// Half-edges, one for each edge that is live.
std::vector<int> Edges(const EditableMesh& mesh) {
  std::vector<int> edges;
  edges.reserve(static_cast<std::size_t>(mesh.num_half_edges()) / 2);
  for (int h = 0; h < mesh.num_half_edges(); ++h) {
    if (mesh.is_live(h) && h < mesh.Twin(h)) edges.push_back(h);
  }
  return edges;
}

class Remesher {
 public:
  Remesher(const AnimalBody& body, RandomStream& random,
           const TriangleMesh& start)
      : body_(body), random_(random), mesh_(start) {
    Move([&](int v) { return body_.Project(mesh_.Point(v), 3); });
  }

  // Goes from the start's edge length to that of `vertices` vertices by factors
  // of 2, then settles there.
  absl::StatusOr<TriangleMesh> Remesh(int vertices) {
    const double wanted = LengthFor(vertices);
    for (double length = LengthFor(mesh_.num_vertices()); length != wanted;) {
      length = std::clamp(wanted, length / 2, length * 2);
      Round(length);
    }
    for (int round = 0; round < kFinalRounds; ++round) Round(wanted);
    if (!ReachCount(vertices)) {
      return absl::InternalError(
          absl::StrCat("the animal cannot be drawn with ", vertices,
                       " vertices, the nearest was ", mesh_.num_vertices()));
    }
    FlipToDelaunay();
    Relax();
    FlipToDelaunay();
    return mesh_.ToMesh();
  }

 private:
  // Edge of the equilateral triangles of which 2 n cover the surface.
  double LengthFor(int vertices) const {
    double area = 0;
    for (int h = 0; h < mesh_.num_half_edges(); h += 3) {
      if (!mesh_.is_live(h)) continue;
      const Vector3d& corner = mesh_.Point(mesh_.Origin(h));
      area += (mesh_.Point(mesh_.Tip(h)) - corner)
                  .cross(mesh_.Point(mesh_.Opposite(h)) - corner)
                  .norm() /
              2;
    }
    return std::sqrt(2 * area / (std::numbers::sqrt3 * vertices));
  }

  void Round(double length) {
    SplitLong(length);
    CollapseShort(length);
    FlipToDelaunay();
    Relax();
  }

  // About the middle, so that no two meshes share their midpoints.
  void SplitEdge(int h) {
    const double t = 0.4 + 0.2 * random_.Unit();
    const Vector3d point =
        (1 - t) * mesh_.Point(mesh_.Origin(h)) + t * mesh_.Point(mesh_.Tip(h));
    mesh_.Split(h, body_.Project(point, 2));
  }

  void SplitLong(double length) {
    // The halves wait for the next round: where the field has a crease the
    // projection may take a new vertex far away, and splitting never end.
    const int end = mesh_.num_half_edges();
    for (int h = 0; h < end; ++h) {
      if (mesh_.is_live(h) &&
          mesh_.SquaredLength(h) > Squared(kLongest * length)) {
        SplitEdge(h);
      }
    }
  }

  // True when collapsing makes no edge that would be split again.
  bool StaysShort(int h, double length) const {
    const Vector3d& kept = mesh_.Point(mesh_.Tip(h));
    bool stays = true;
    mesh_.ForEachOut(mesh_.Origin(h), [&](int out) {
      stays = stays && (mesh_.Point(mesh_.Tip(out)) - kept).squaredNorm() <
                           Squared(kLongest * length);
    });
    return stays;
  }

  void CollapseShort(double length) {
    for (int h = 0; h < mesh_.num_half_edges(); ++h) {
      if (mesh_.is_live(h) &&
          mesh_.SquaredLength(h) < Squared(kShortest * length) &&
          StaysShort(h, length) && mesh_.CanCollapse(h)) {
        mesh_.Collapse(h);
      }
    }
  }

  // Cotangent of the angle opposite to h in its face.
  double Cotangent(int h) const {
    const Vector3d& corner = mesh_.Point(mesh_.Opposite(h));
    const Vector3d a = mesh_.Point(mesh_.Origin(h)) - corner;
    const Vector3d b = mesh_.Point(mesh_.Tip(h)) - corner;
    return a.dot(b) / std::max(a.cross(b).norm(), 1e-300);
  }

  // True when both faces after a flip look the way both did before.
  bool FlipKeepsSides(int h) const {
    const Vector3d& a = mesh_.Point(mesh_.Origin(h));
    const Vector3d& b = mesh_.Point(mesh_.Tip(h));
    const Vector3d& c = mesh_.Point(mesh_.Opposite(h));
    const Vector3d& d = mesh_.Point(mesh_.Opposite(mesh_.Twin(h)));
    const Vector3d before = (b - a).cross(c - a) + (d - a).cross(b - a);
    return (d - a).cross(c - a).dot(before) > 0 &&
           (b - d).cross(c - d).dot(before) > 0;
  }

  void FlipToDelaunay() {
    constexpr int kSweeps = 3;
    // Opposite angles of a square's diagonal sum to pi: no endless flipping.
    constexpr double kRounding = -1e-9;
    for (int sweep = 0; sweep < kSweeps; ++sweep) {
      for (int h = 0; h < mesh_.num_half_edges(); ++h) {
        if (mesh_.is_live(h) && h < mesh_.Twin(h) &&
            Cotangent(h) + Cotangent(mesh_.Twin(h)) < kRounding &&
            FlipKeepsSides(h) && mesh_.CanFlip(h)) {
          mesh_.Flip(h);
        }
      }
    }
  }

  // Moves every vertex to place(vertex), all at once.
  template <typename Place>
  void Move(const Place& place) {
    std::vector<Vector3d> moved = mesh_.points;
    const int end = mesh_.end_vertex();
    const absl::Status status = ParallelFor(
        (end + kBlock - 1) / kBlock, std::stop_token(), [&](std::int64_t b) {
          const int first = static_cast<int>(b) * kBlock;
          for (int v = first; v < std::min(first + kBlock, end); ++v) {
            if (mesh_.is_live_vertex(v)) {
              moved[static_cast<std::size_t>(v)] = place(v);
            }
          }
        });
    assert(status.ok());
    mesh_.points = std::move(moved);
  }

  // Toward the mean of the neighbors, within the surface.
  void Relax() {
    constexpr double kPart = 0.7;
    Move([&](int v) {
      Vector3d sum = Vector3d::Zero();
      int valence = 0;
      mesh_.ForEachOut(v, [&](int out) {
        sum += mesh_.Point(mesh_.Tip(out));
        ++valence;
      });
      const Vector3d& point = mesh_.Point(v);
      const Vector3d normal = body_.At(point).gradient.normalized();
      Vector3d step = kPart * (sum / valence - point);
      step -= step.dot(normal) * normal;
      return body_.Project(point + step, 1);
    });
  }

  // Collapses the shortest or splits the longest edges, a tenth of what is
  // missing at a time at least, until the count is right.
  bool ReachCount(int vertices) {
    constexpr int kMaxRounds = 100;
    for (int round = 0; round < kMaxRounds; ++round) {
      const int surplus = mesh_.num_vertices() - vertices;
      if (surplus == 0) return true;
      std::vector<std::pair<double, int>> edges;
      for (const int h : Edges(mesh_)) {
        const double length = mesh_.SquaredLength(h);
        edges.emplace_back(surplus > 0 ? length : -length, h);
      }
      std::sort(edges.begin(), edges.end());
      ChangeFirst(edges, surplus);
      FlipToDelaunay();
    }
    return mesh_.num_vertices() == vertices;
  }

  void ChangeFirst(const std::vector<std::pair<double, int>>& edges,
                   int surplus) {
    int left = std::abs(surplus);
    // Only edges that are still what they were when they were sorted.
    for (const auto& [length, h] : edges) {
      if (left == 0) return;
      if (!mesh_.is_live(h) || mesh_.SquaredLength(h) != std::abs(length)) {
        continue;
      }
      if (surplus < 0) {
        SplitEdge(h);
        --left;
      } else if (mesh_.CanCollapse(h)) {
        mesh_.Collapse(h);
        --left;
      }
    }
  }

  const AnimalBody& body_;
  RandomStream& random_;
  EditableMesh mesh_;
};

}  // namespace

absl::StatusOr<TriangleMesh> MeshSurface(const AnimalBody& body, int vertices,
                                         RandomStream& random) {
  TriangleMesh start = MarchTetrahedra(body, kFirstStep, random);
  return Remesher(body, random, std::move(start)).Remesh(vertices);
}

}  // namespace isomatch
