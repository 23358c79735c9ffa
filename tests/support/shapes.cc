#include "tests/support/shapes.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <random>
#include <utility>

#include <Eigen/Geometry>

#include "core/base/random_stream.h"

namespace isomatch {
namespace {

TriangleMesh FromRows(const std::vector<Eigen::RowVector3d>& positions,
                      const std::vector<Eigen::RowVector3i>& faces) {
  TriangleMesh mesh;
  mesh.positions.resize(positions.size(), 3);
  for (std::size_t i = 0; i < positions.size(); ++i) {
    mesh.positions.row(i) = positions[i];
  }
  mesh.faces.resize(faces.size(), 3);
  for (std::size_t i = 0; i < faces.size(); ++i) mesh.faces.row(i) = faces[i];
  return mesh;
}

struct Icosphere {
  std::vector<Eigen::RowVector3d> positions;
  std::vector<Eigen::RowVector3i> faces;
};

Icosphere Icosahedron() {
  const double t = (1 + std::sqrt(5.0)) / 2;
  Icosphere ico;
  ico.positions = {{-1, t, 0}, {1, t, 0}, {-1, -t, 0}, {1, -t, 0},
                   {0, -1, t}, {0, 1, t}, {0, -1, -t}, {0, 1, -t},
                   {t, 0, -1}, {t, 0, 1}, {-t, 0, -1}, {-t, 0, 1}};
  ico.faces = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
               {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
               {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
               {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  for (auto& p : ico.positions) p.normalize();
  return ico;
}

void Subdivide(Icosphere* sphere) {
  std::map<std::pair<int, int>, int> middle_of;
  const auto middle = [&](int a, int b) {
    const auto [it, is_new] = middle_of.try_emplace(
        std::minmax(a, b), static_cast<int>(sphere->positions.size()));
    if (is_new) {
      sphere->positions.push_back(
          (sphere->positions[a] + sphere->positions[b]).normalized());
    }
    return it->second;
  };
  std::vector<Eigen::RowVector3i> faces;
  for (const auto& f : sphere->faces) {
    const int ab = middle(f[0], f[1]);
    const int bc = middle(f[1], f[2]);
    const int ca = middle(f[2], f[0]);
    faces.emplace_back(f[0], ab, ca);
    faces.emplace_back(f[1], bc, ab);
    faces.emplace_back(f[2], ca, bc);
    faces.emplace_back(ab, bc, ca);
  }
  sphere->faces = std::move(faces);
}

struct Bump {
  Eigen::RowVector3d direction;
  double height;
  double width;  ///< radians
};

/// The unit sphere with its radius raised around each bump's direction.
TriangleMesh SphereWithBumps(int levels, const std::vector<Bump>& bumps) {
  TriangleMesh mesh = UnitSphere(levels);
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    const Eigen::RowVector3d p = mesh.positions.row(v);
    double radius = 1;
    for (const Bump& bump : bumps) {
      const double angle =
          std::acos(std::clamp(p.dot(bump.direction.normalized()), -1.0, 1.0));
      radius += bump.height * std::exp(-std::pow(angle / bump.width, 2));
    }
    mesh.positions.row(v) = radius * p;
  }
  return mesh;
}

}  // namespace

TriangleMesh UnitSphere(int levels) {
  Icosphere sphere = Icosahedron();
  for (int i = 0; i < levels; ++i) Subdivide(&sphere);
  return FromRows(sphere.positions, sphere.faces);
}

TriangleMesh PlaneGrid(int columns, int rows, double width, double height) {
  TriangleMesh mesh;
  mesh.positions.resize((columns + 1) * (rows + 1), 3);
  mesh.faces.resize(2 * columns * rows, 3);
  int face = 0;
  for (int r = 0; r <= rows; ++r) {
    for (int c = 0; c <= columns; ++c) {
      const int v = r * (columns + 1) + c;
      mesh.positions.row(v) << width * c / columns, height * r / rows, 0;
      if (r == rows || c == columns) continue;
      const int up = v + columns + 1;
      mesh.faces.row(face++) << v, v + 1, up + 1;
      mesh.faces.row(face++) << v, up + 1, up;
    }
  }
  return mesh;
}

TriangleMesh Torus(int around, int across) {
  constexpr double kTube = 0.4;
  TriangleMesh mesh;
  mesh.positions.resize(around * across, 3);
  mesh.faces.resize(2 * around * across, 3);
  for (int i = 0; i < around; ++i) {
    for (int j = 0; j < across; ++j) {
      const double u = 2 * std::numbers::pi * i / around;
      const double v = 2 * std::numbers::pi * j / across;
      const double radius = 1 + kTube * std::cos(v);
      const int corner = i * across + j;
      mesh.positions.row(corner) << radius * std::cos(u), radius * std::sin(u),
          kTube * std::sin(v);
      const int next_i = (i + 1) % around * across;
      const int next_j = (j + 1) % across;
      mesh.faces.row(2 * corner) << corner, next_i + j, next_i + next_j;
      mesh.faces.row(2 * corner + 1) << corner, next_i + next_j,
          i * across + next_j;
    }
  }
  return mesh;
}

TriangleMesh Tetrahedron() {
  return FromRows({{0, 0, 0}, {1, 0, 0}, {0.1, 1.3, 0}, {0.2, 0.3, 1.7}},
                  {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}});
}

TriangleMesh BumpySphere(int levels) {
  return SphereWithBumps(levels, {{{1, 0.1, 0}, 0.9, 0.5},
                                  {{-0.4, 1, 0.2}, 0.6, 0.45},
                                  {{0.1, -0.3, 1}, 0.75, 0.4},
                                  {{-0.5, -0.8, -0.6}, 0.45, 0.5}});
}

TriangleMesh FiveArms(int levels) {
  return SphereWithBumps(levels, {{{1, 0.1, 0.05}, 2.6, 0.32},
                                  {{0.2, 1, 0.1}, 2.2, 0.3},
                                  {{-0.9, 0.5, 0.1}, 1.9, 0.32},
                                  {{-0.6, -0.9, 0.2}, 1.6, 0.3},
                                  {{0.3, -0.6, 0.9}, 1.3, 0.34}});
}

TriangleMesh MirrorSymmetricBody(int levels) {
  return SphereWithBumps(levels, {{{1, 0.2, 0}, 2.0, 0.32},
                                  {{-1, 0.6, 0}, 1.2, 0.3},
                                  {{0.5, -0.6, 0.8}, 1.7, 0.3},
                                  {{0.5, -0.6, -0.8}, 1.7, 0.3},
                                  {{-0.6, -0.7, 0.7}, 1.4, 0.3},
                                  {{-0.6, -0.7, -0.7}, 1.4, 0.3}});
}

TriangleMesh Relabeled(const TriangleMesh& mesh,
                       const std::vector<VertexIndex>& new_from_old) {
  TriangleMesh result = mesh;
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    result.positions.row(new_from_old[v]) = mesh.positions.row(v);
  }
  for (Eigen::Index i = 0; i < mesh.faces.size(); ++i) {
    result.faces.data()[i] = new_from_old[mesh.faces.data()[i]];
  }
  return result;
}

std::vector<VertexIndex> RandomPermutation(VertexIndex n, std::uint64_t seed) {
  std::vector<VertexIndex> permutation = IdentityMap(n);
  RandomStream random(seed, /*index=*/0);
  for (VertexIndex i = n - 1; i > 0; --i) {
    std::swap(permutation[i], permutation[random.Below(i + 1)]);
  }
  return permutation;
}

std::vector<VertexIndex> IdentityMap(VertexIndex n) {
  std::vector<VertexIndex> map(n);
  std::iota(map.begin(), map.end(), 0);
  return map;
}

double FractionRight(const std::vector<VertexIndex>& found,
                     const std::vector<VertexIndex>& truth) {
  int right = 0;
  for (std::size_t v = 0; v < truth.size(); ++v) right += found[v] == truth[v];
  return double(right) / double(truth.size());
}

TriangleMesh Moved(const TriangleMesh& mesh, double scale) {
  TriangleMesh result = mesh;
  const Eigen::Matrix3d rotation =
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized())
          .toRotationMatrix();
  result.positions = scale * (mesh.positions * rotation.transpose());
  result.positions.rowwise() += scale * Eigen::RowVector3d(3, -2, 5);
  return result;
}

TriangleMesh AnyFaces(VertexIndex vertices) {
  std::mt19937 random(1);
  const auto below = [&](VertexIndex end) {
    return static_cast<VertexIndex>(random() % static_cast<unsigned>(end));
  };
  TriangleMesh mesh;
  mesh.positions.resize(vertices, 3);
  for (VertexIndex v = 0; v < vertices; ++v) {
    mesh.positions.row(v) << below(1000), below(1000), below(1000);
  }
  mesh.faces.resize(Eigen::Index{3} * vertices, 3);
  for (Eigen::Index f = 0; f < mesh.faces.rows(); ++f) {
    mesh.faces.row(f) << below(vertices), below(vertices), below(vertices);
  }
  return mesh;
}

}  // namespace isomatch
