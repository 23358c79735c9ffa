#include "client/files/mesh_weld.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "absl/container/inlined_vector.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/strip.h"
#include "core/base/status_macros.h"
#include "core/mesh/disjoint_sets.h"
#include "core/mesh/mesh_geometry.h"
#include "core/mesh/topology.h"

namespace isomatch {
namespace {

// What is farther apart is a shape's own detail.
constexpr double kMostOfDiagonal = 0.1;
// Components that nobody would call a body with parts.
constexpr std::int64_t kManyComponents = 20;
constexpr double kMostAreClose = 0.5;
// As a fraction of the mean edge length: gaps up to this are left by rounding,
// larger ones belong to the shape.
constexpr double kCloseInEdges = 0.05;
// A twentieth of an edge around a vertex there are few others, but in files
// made to have them.
constexpr std::size_t kMostInCell = 32;

double Diagonal(const TriangleMesh& mesh) {
  return BoxOfFaces(mesh).sizes().norm();
}

// Vertices by cubes of a side; those within that length of a point are in its
// cube and the 26 around it.
class VertexGrid {
 public:
  VertexGrid(const Positions& positions, double side)
      : positions_(positions),
        low_(positions.colwise().minCoeff()),
        side_(side) {}

  void Add(VertexIndex v) { cells_[CellOf(v)].push_back(v); }

  std::size_t SizeAt(VertexIndex v) const {
    const auto cell = cells_.find(CellOf(v));
    return cell == cells_.end() ? 0 : cell->second.size();
  }

  // Calls visit(w, squared distance) for each added vertex within the side.
  template <typename Visitor>
  void VisitAround(VertexIndex v, const Visitor& visit) const {
    const Cell middle = CellOf(v);
    for (int i = 0; i < 27; ++i) {
      const int column = i % 3 - 1;
      const int row = i / 3 % 3 - 1;
      const int layer = i / 9 - 1;
      const auto cell =
          cells_.find({middle[0] + column, middle[1] + row, middle[2] + layer});
      if (cell == cells_.end()) continue;
      for (const VertexIndex w : cell->second) {
        const double squared =
            (positions_.row(v) - positions_.row(w)).squaredNorm();
        if (squared <= side_ * side_) visit(w, squared);
      }
    }
  }

 private:
  // Whole numbers; doubles do not overflow.
  using Cell = std::array<double, 3>;

  Cell CellOf(VertexIndex v) const {
    Cell cell;
    for (int axis = 0; axis < 3; ++axis) {
      cell[static_cast<std::size_t>(axis)] =
          std::floor((positions_(v, axis) - low_[axis]) / side_);
    }
    return cell;
  }

  const Positions& positions_;
  const Eigen::RowVector3d low_;
  const double side_;
  absl::flat_hash_map<Cell, absl::InlinedVector<VertexIndex, 2>> cells_;
};

// Drops faces two of whose corners have one position now, unless both are on a
// rim, where cleaning joins them. Without such a face its corners are on one.
void DropCollapsed(TriangleMesh* mesh) {
  const std::vector<char> is_on_rim =
      RimVertices(*mesh, EdgeFaces(mesh->faces), /*nonmanifold=*/true);
  const auto collapses = [&](VertexIndex f) {
    for (int corner = 0; corner < 3; ++corner) {
      const VertexIndex a = mesh->faces(f, corner);
      const VertexIndex b = mesh->faces(f, (corner + 1) % 3);
      if (a != b && mesh->positions.row(a) == mesh->positions.row(b) &&
          !(is_on_rim[a] && is_on_rim[b])) {
        return true;
      }
    }
    return false;
  };
  VertexIndex kept = 0;
  for (VertexIndex f = 0; f < mesh->num_faces(); ++f) {
    if (!collapses(f)) mesh->faces.row(kept++) = mesh->faces.row(f).eval();
  }
  mesh->faces.conservativeResize(kept, 3);
}

std::vector<int> CountFacesAtVertices(const TriangleMesh& mesh) {
  std::vector<int> count(static_cast<std::size_t>(mesh.num_vertices()));
  for (const VertexIndex corner : mesh.faces.reshaped()) {
    ++count[static_cast<std::size_t>(corner)];
  }
  return count;
}

// Vertices that had faces and have none any more go back to a face of their
// place: one takes a corner there, others get copies of that face. All are on a
// rim then, where cleaning joins them, after which the copies repeat a face.
// `before` counts faces of vertices, `joined` names one vertex of each.
void KeepOnFaces(const std::vector<int>& before, const VertexMap& joined,
                 TriangleMesh* mesh) {
  std::vector<int> count = CountFacesAtVertices(*mesh);
  absl::flat_hash_map<VertexIndex, VertexMap> lost;
  for (std::size_t v = 0; v < count.size(); ++v) {
    if (before[v] == 0 || count[v] > 0) continue;
    lost[joined[v]].push_back(static_cast<VertexIndex>(v));
  }
  if (lost.empty()) return;
  Faces& faces = mesh->faces;
  std::vector<std::array<VertexIndex, 3>> copies;
  for (VertexIndex f = 0; f < faces.rows(); ++f) {
    for (int corner = 0; corner < 3; ++corner) {
      const auto owner = static_cast<std::size_t>(faces(f, corner));
      const auto found = lost.find(joined[owner]);
      if (found == lost.end()) continue;
      VertexMap& vertices = found->second;
      if (count[owner] > 1) {
        --count[owner];
        faces(f, corner) = vertices.back();
        vertices.pop_back();
      }
      for (const VertexIndex v : vertices) {
        copies.push_back({faces(f, 0), faces(f, 1), faces(f, 2)});
        copies.back()[static_cast<std::size_t>(corner)] = v;
      }
      lost.erase(found);
    }
  }
  const Eigen::Index own = faces.rows();
  faces.conservativeResize(own + static_cast<Eigen::Index>(copies.size()), 3);
  for (std::size_t i = 0; i < copies.size(); ++i) {
    faces.row(own + static_cast<Eigen::Index>(i)) =
        Eigen::Map<const Eigen::RowVector3i>(copies[i].data());
  }
}

// Rounded up to one digit.
double RoundedUp(double length) {
  const double power = std::pow(10, std::floor(std::log10(length)));
  return std::ceil(length / power * (1 - 1e-9)) * power;
}

// 1234567 as "1,234,567".
std::string WithCommas(std::int64_t number) {
  constexpr std::int64_t kGroup = 1000;
  return number < kGroup
             ? absl::StrCat(number)
             : absl::StrFormat("%s,%03d", WithCommas(number / kGroup),
                               number % kGroup);
}

}  // namespace

double WeldTolerance::LengthFor(const TriangleMesh& mesh) const {
  return is_of_diagonal ? value * Diagonal(mesh) : value;
}

absl::StatusOr<WeldTolerance> ParseWeldTolerance(const std::string& text) {
  WeldTolerance tolerance;
  absl::string_view number = text;
  tolerance.is_of_diagonal = absl::ConsumeSuffix(&number, "%");
  const bool is_number = absl::SimpleAtod(number, &tolerance.value);
  if (tolerance.is_of_diagonal) tolerance.value /= 100;
  const double most = tolerance.is_of_diagonal
                          ? kMostOfDiagonal
                          : std::numeric_limits<double>::max();
  if (is_number && tolerance.value > 0 && tolerance.value <= most) {
    return tolerance;
  }
  return absl::InvalidArgumentError(absl::StrCat(
      "--weld is '", text,
      "', expected a length above 0 in mesh units, e.g. 1e-6, or a part of the "
      "bounding box's diagonal up to 10%, e.g. 0.001%"));
}

absl::StatusOr<VertexIndex> WeldVertices(const WeldTolerance& tolerance,
                                         TriangleMesh* mesh) {
  const double length = tolerance.LengthFor(*mesh);
  const double diagonal = Diagonal(*mesh);
  if (!(length <= kMostOfDiagonal * diagonal)) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "--weld %g is more than a tenth of the bounding box's diagonal (%g)",
        length, diagonal));
  }
  if (!(length > 0)) return 0;
  VertexGrid grid(mesh->positions, length);
  VertexMap joined(static_cast<std::size_t>(mesh->num_vertices()));
  std::iota(joined.begin(), joined.end(), 0);
  for (VertexIndex v = 0; v < mesh->num_vertices(); ++v) {
    VertexIndex first = kNoVertex;
    grid.VisitAround(v, [&](VertexIndex w, double) {
      if (first == kNoVertex || w < first) first = w;
    });
    if (first == kNoVertex) {
      grid.Add(v);
    } else {
      joined[static_cast<std::size_t>(v)] = first;
    }
  }
  VertexIndex moved = 0;
  for (VertexIndex v = 0; v < mesh->num_vertices(); ++v) {
    const Eigen::RowVector3d there =
        mesh->positions.row(joined[static_cast<std::size_t>(v)]);
    moved += mesh->positions.row(v) != there;
    mesh->positions.row(v) = there;
  }
  const std::vector<int> faces_before = CountFacesAtVertices(*mesh);
  DropCollapsed(mesh);
  KeepOnFaces(faces_before, joined, mesh);
  const std::string field = absl::StrFormat("--weld %g", length);
  if (mesh->num_faces() == 0) {
    return absl::InvalidArgumentError(absl::StrCat(field, " leaves no face"));
  }
  ISOMATCH_RETURN_IF_ERROR(ValidateMesh(*mesh, field));
  return moved;
}

std::string WeldAdvice::Text() const {
  return absl::StrFormat(
      "%s components, %s of them within %.2g of another: probably a triangle "
      "soup; try --weld %.2g",
      WithCommas(components), WithCommas(close), distance, tolerance);
}

std::optional<WeldAdvice> AdviseWeld(const TriangleMesh& mesh) {
  const VertexIndex vertices = mesh.num_vertices();
  DisjointSets sets(vertices);
  std::vector<char> is_on_face(static_cast<std::size_t>(vertices));
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    for (int i = 0; i < 3; ++i) {
      sets.Join(mesh.faces(f, 0), mesh.faces(f, i));
      is_on_face[static_cast<std::size_t>(mesh.faces(f, i))] = true;
    }
  }
  // At most: some may join where their vertices coincide.
  std::int64_t components = 0;
  for (VertexIndex v = 0; v < vertices; ++v) {
    components += is_on_face[static_cast<std::size_t>(v)] && sets.Find(v) == v;
  }
  if (components < kManyComponents) return std::nullopt;
  const double side = kCloseInEdges * MeanEdgeLength(mesh);
  if (!(side > 0) || !std::isfinite(side)) return std::nullopt;
  VertexGrid grid(mesh.positions, side);
  for (VertexIndex v = 0; v < vertices; ++v) {
    if (!is_on_face[static_cast<std::size_t>(v)]) continue;
    bool is_new = true;
    grid.VisitAround(v, [&](VertexIndex w, double squared) {
      if (squared > 0) return;
      sets.Join(v, w);
      is_new = false;
    });
    if (is_new && grid.SizeAt(v) < kMostInCell) grid.Add(v);
  }
  // Finds the vertices and components that are close to another component.
  absl::flat_hash_map<VertexIndex, bool> is_close;
  std::vector<double> distances;
  for (VertexIndex v = 0; v < vertices; ++v) {
    if (!is_on_face[static_cast<std::size_t>(v)]) continue;
    const VertexIndex own = sets.Find(v);
    double least = std::numeric_limits<double>::infinity();
    grid.VisitAround(v, [&](VertexIndex w, double squared) {
      if (sets.Find(w) != own) least = std::min(least, squared);
    });
    is_close[own] |= std::isfinite(least);
    if (std::isfinite(least)) distances.push_back(std::sqrt(least));
  }
  WeldAdvice advice;
  advice.components = static_cast<std::int64_t>(is_close.size());
  for (const auto& [component, close] : is_close) advice.close += close;
  if (advice.components < kManyComponents ||
      static_cast<double>(advice.close) <
          kMostAreClose * static_cast<double>(advice.components)) {
    return std::nullopt;
  }
  // Twice what nearly all have reaches over vertices that several share.
  const auto nearly_all =
      distances.begin() +
      static_cast<std::ptrdiff_t>(0.99 * double(distances.size() - 1));
  std::nth_element(distances.begin(), nearly_all, distances.end());
  advice.distance = RoundedUp(*nearly_all);
  advice.tolerance = 2 * advice.distance;
  return advice;
}

}  // namespace isomatch
