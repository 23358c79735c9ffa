#include "client/sample/marching_tetrahedra.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stop_token>
#include <unordered_map>
#include <vector>

#include "core/base/parallel.h"

namespace isomatch {
namespace {

using Eigen::Vector3d;
using Cell = Eigen::Matrix<std::int64_t, 3, 1>;

// The body's box in a frame turned by up to this.
constexpr double kMaxTurn = 0.25;

// Kuhn's cut of a cube into 6 tetrahedra around its main diagonal; bit i of a
// corner is its step along axis i. Neighboring cubes agree on their faces.
constexpr std::array<std::array<int, 4>, 6> kTetrahedra = {{{0, 1, 3, 7},
                                                            {0, 3, 2, 7},
                                                            {0, 2, 6, 7},
                                                            {0, 6, 4, 7},
                                                            {0, 4, 5, 7},
                                                            {0, 5, 1, 7}}};

Vector3d CornerOffset(int corner) {
  return {static_cast<double>(corner & 1), static_cast<double>(corner >> 1 & 1),
          static_cast<double>(corner >> 2)};
}

// A grid in a frame of its own around the body, with the field at its nodes.
class Grid {
 public:
  Grid(const AnimalBody& body, double step, RandomStream& random)
      : step_(step), turn_(RandomTurn(random)) {
    Eigen::AlignedBox3d box;
    const Eigen::AlignedBox3d bounds = body.Bounds();
    for (int corner = 0; corner < 8; ++corner) {
      box.extend(
          turn_.inverse() *
          bounds.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner)));
    }
    first_ = box.min();
    for (double& coordinate : first_) coordinate -= step * random.Unit();
    size_ = ((box.max() - first_) / step)
                .array()
                .ceil()
                .cast<std::int64_t>()
                .matrix() +
            Cell::Ones();
    Evaluate(body);
  }

  const Cell& size() const { return size_; }
  std::int64_t NodeOf(const Cell& cell) const {
    return (cell[2] * size_[1] + cell[1]) * size_[0] + cell[0];
  }
  std::int64_t CornerOf(std::int64_t node, int corner) const {
    return node + (corner & 1) + (corner >> 1 & 1) * size_[0] +
           (corner >> 2) * size_[0] * size_[1];
  }
  double Value(std::int64_t node) const {
    return values_[static_cast<std::size_t>(node)];
  }
  Vector3d PositionOf(std::int64_t node) const {
    const std::int64_t row = node / size_[0];
    const Cell at(node % size_[0], row % size_[1], row / size_[1]);
    return turn_ * (first_ + step_ * at.cast<double>());
  }

 private:
  static Eigen::Quaterniond RandomTurn(RandomStream& random) {
    Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
    for (int axis = 0; axis < 3; ++axis) {
      const double angle = kMaxTurn * (2 * random.Unit() - 1);
      turn = turn * Eigen::AngleAxisd(angle, Vector3d::Unit(axis));
    }
    return turn;
  }

  void Evaluate(const AnimalBody& body) {
    values_.resize(static_cast<std::size_t>(size_.prod()));
    const std::int64_t row = size_[0];
    const absl::Status status = ParallelFor(
        size_[1] * size_[2], std::stop_token(), [&](std::int64_t r) {
          for (std::int64_t i = r * row; i < (r + 1) * row; ++i) {
            values_[static_cast<std::size_t>(i)] = body.At(PositionOf(i)).value;
          }
        });
    assert(status.ok());
  }

  double step_;
  Eigen::Quaterniond turn_;
  Vector3d first_;
  Cell size_;
  std::vector<double> values_;
};

class Marcher {
 public:
  explicit Marcher(const Grid& grid) : grid_(grid) {}

  TriangleMesh March() {
    const Cell& size = grid_.size();
    for (std::int64_t z = 0; z + 1 < size[2]; ++z) {
      for (std::int64_t y = 0; y + 1 < size[1]; ++y) {
        for (std::int64_t x = 0; x + 1 < size[0]; ++x) {
          MarchCube(grid_.NodeOf({x, y, z}));
        }
      }
    }
    return ToMesh();
  }

 private:
  void MarchCube(std::int64_t node) {
    int inside = 0;
    for (int corner = 0; corner < 8; ++corner) {
      inside += grid_.Value(grid_.CornerOf(node, corner)) < 0;
    }
    if (inside == 0 || inside == 8) return;
    for (const std::array<int, 4>& tetrahedron : kTetrahedra) {
      MarchTetrahedron(node, tetrahedron);
    }
  }

  // Corners of the cube that are inside, or outside, among the tetrahedron's.
  void MarchTetrahedron(std::int64_t node, const std::array<int, 4>& corners) {
    std::vector<int> in;
    std::vector<int> out;
    for (const int corner : corners) {
      const bool inside = grid_.Value(grid_.CornerOf(node, corner)) < 0;
      (inside ? in : out).push_back(corner);
    }
    if (in.size() == 1) {
      AddFace(node, {{{in[0], out[0]}, {in[0], out[1]}, {in[0], out[2]}}});
    } else if (in.size() == 3) {
      AddFace(node, {{{in[0], out[0]}, {in[1], out[0]}, {in[2], out[0]}}});
    } else if (in.size() == 2) {
      AddFace(node, {{{in[0], out[0]}, {in[0], out[1]}, {in[1], out[1]}}});
      AddFace(node, {{{in[0], out[0]}, {in[1], out[1]}, {in[1], out[0]}}});
    }
  }

  // An edge of a tetrahedron from an inner to an outer corner.
  struct Crossing {
    int in;
    int out;
  };

  // Turns the face outward by its edges' midpoints, which never degenerate.
  void AddFace(std::int64_t node, const std::array<Crossing, 3>& crossings) {
    std::array<Vector3d, 3> middle;
    Vector3d outward = Vector3d::Zero();
    std::array<VertexIndex, 3> face;
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector3d in = CornerOffset(crossings[i].in);
      const Vector3d out = CornerOffset(crossings[i].out);
      middle[i] = (in + out) / 2;
      outward += out - in;
      face[i] = VertexOn(grid_.CornerOf(node, crossings[i].in),
                         grid_.CornerOf(node, crossings[i].out));
    }
    const Vector3d normal =
        (middle[1] - middle[0]).cross(middle[2] - middle[0]);
    if (normal.dot(outward) < 0) std::swap(face[1], face[2]);
    faces_.push_back(face);
  }

  // The vertex on the edge between two nodes, made at first use.
  VertexIndex VertexOn(std::int64_t in, std::int64_t out) {
    const std::int64_t low = std::min(in, out);
    const std::int64_t key = low * kEdgeKeys + CodeOf(std::max(in, out) - low);
    const auto [entry, is_new] =
        vertex_on_.emplace(key, static_cast<VertexIndex>(points_.size()));
    if (is_new) {
      // Away from the nodes, where several vertices would coincide.
      const double t = std::clamp(
          grid_.Value(in) / (grid_.Value(in) - grid_.Value(out)), 0.1, 0.9);
      points_.push_back((1 - t) * grid_.PositionOf(in) +
                        t * grid_.PositionOf(out));
    }
    return entry->second;
  }

  // 1 to 7: the corner of the cube that a step in node numbers leads to.
  int CodeOf(std::int64_t difference) const {
    int code = 1;
    while (grid_.CornerOf(0, code) != difference) ++code;
    return code;
  }

  TriangleMesh ToMesh() const {
    TriangleMesh mesh{Positions(static_cast<Eigen::Index>(points_.size()), 3),
                      Faces(static_cast<Eigen::Index>(faces_.size()), 3)};
    for (std::size_t v = 0; v < points_.size(); ++v) {
      mesh.positions.row(static_cast<Eigen::Index>(v)) = points_[v];
    }
    for (std::size_t f = 0; f < faces_.size(); ++f) {
      const std::array<VertexIndex, 3>& face = faces_[f];
      mesh.faces.row(static_cast<Eigen::Index>(f)) << face[0], face[1], face[2];
    }
    return mesh;
  }

  static constexpr int kEdgeKeys = 8;

  const Grid& grid_;
  std::unordered_map<std::int64_t, VertexIndex> vertex_on_;
  std::vector<Vector3d> points_;
  std::vector<std::array<VertexIndex, 3>> faces_;
};

}  // namespace

TriangleMesh MarchTetrahedra(const AnimalBody& body, double step,
                             RandomStream& random) {
  const Grid grid(body, step, random);
  return Marcher(grid).March();
}

}  // namespace isomatch
