#include "client/transfer/texture_carrier.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <tuple>
#include <unordered_map>
#include <utility>
#include <vector>

#include "core/base/parallel.h"
#include "core/base/status_macros.h"
#include "core/mesh/clean_mesh.h"
#include "core/mesh/surface_point.h"
#include "core/mesh/topology.h"
#include "core/mesh/vertex_stars.h"

namespace isomatch {
namespace {

using Coordinates = Eigen::RowVector2d;
using FaceCorners = std::array<Coordinates, 3>;

// Weights below it are rounding: places travel in single precision.
constexpr double kNoWeight = 1e-6;
// How much farther than its own corners a face of X may look for a way.
constexpr double kReach = 1.5;
// A sheet larger than this belongs to a face of X that the map has torn.
constexpr std::size_t kMostFaces = 5'000;
// How much longer than the way over seams a way around them may be.
constexpr double kDetour = 1.5;
constexpr int kDetourEdges = 2;
constexpr int kAnyDepth = std::numeric_limits<int>::max();

// Y with doubled vertices joined: the same vertices and faces, by number, but
// of vertices that are one only the first is on faces.
TriangleMesh Welded(const TriangleMesh& mesh_y) {
  const CleanMesh clean = Clean(AsSent(mesh_y));
  TriangleMesh welded = mesh_y;
  for (VertexIndex& corner : welded.faces.reshaped()) {
    const VertexIndex joined = clean.clean_from_original[corner];
    // Vertices that are only on faces which cleaning drops stay as they are.
    if (joined != kNoVertex) corner = clean.original_from_clean[joined];
  }
  return welded;
}

// Where a corner of a face of X lies: vertices of the welded Y, by weight.
struct Corner {
  int count = 0;
  std::array<VertexIndex, 3> vertices = {kNoVertex, kNoVertex, kNoVertex};
  std::array<double, 3> weights = {0, 0, 0};
  Eigen::RowVector3d position = Eigen::RowVector3d::Zero();
};

// Some faces of Y that hang together without a seam, by the order of visiting.
struct Sheet {
  std::vector<VertexIndex> faces;
  // Where each of the three corners was met; kNoVertex for not.
  std::array<VertexIndex, 3> face_of_corner = {kNoVertex, kNoVertex, kNoVertex};
  int met = 0;
  // Edges to the last one that was met.
  int depth = 0;
  // Some face of it is beside a seam.
  bool has_seam = false;
};

// Y as all faces of X look at it. Thread-safe.
class TexturedSurface {
 public:
  TexturedSurface(const TriangleMesh& mesh_y, const MeshTexture& texture)
      : texture_(texture),
        mesh_(Welded(mesh_y)),
        edges_(mesh_.faces),
        stars_(mesh_),
        welded_from_y_(static_cast<std::size_t>(mesh_y.num_vertices()),
                       kNoVertex) {
    for (Eigen::Index i = 0; i < mesh_y.faces.size(); ++i) {
      welded_from_y_[static_cast<std::size_t>(mesh_y.faces.data()[i])] =
          mesh_.faces.data()[i];
    }
  }

  const TriangleMesh& mesh() const { return mesh_; }
  int MaterialOf(VertexIndex face) const {
    return texture_.material_of_face[static_cast<std::size_t>(face)];
  }

  bool IsTextured(VertexIndex face) const {
    return texture_.corners.row(face).minCoeff() >= 0;
  }

  // The face beyond a side; kNoVertex at a rim.
  VertexIndex Across(VertexIndex face, int corner) const {
    return edges_.Opposite(face, corner).face;
  }

  // The same, and kNoVertex at a seam too.
  VertexIndex Beyond(VertexIndex face, int corner) const {
    const EdgeFaces::Side other = edges_.Opposite(face, corner);
    if (other.face == kNoVertex || !IsTextured(other.face) ||
        MaterialOf(face) != MaterialOf(other.face)) {
      return kNoVertex;
    }
    for (const int end : {corner, (corner + 1) % 3}) {
      const VertexIndex vertex = mesh_.faces(face, end);
      const int same = mesh_.faces(other.face, other.corner) == vertex
                           ? other.corner
                           : (other.corner + 1) % 3;
      if (CoordinatesOf(face, end) != CoordinatesOf(other.face, same))
        return kNoVertex;
    }
    return other.face;
  }

  // Nothing for a place that is nowhere or on no face.
  std::optional<Corner> ToCorner(const PrecisePoint& point) const {
    Corner corner;
    for (std::size_t i = 0; i < 3; ++i) {
      if (point.vertices[i] == kNoVertex) return std::nullopt;
      if (point.weights[i] < kNoWeight) continue;
      const VertexIndex vertex =
          welded_from_y_[static_cast<std::size_t>(point.vertices[i])];
      if (vertex == kNoVertex) return std::nullopt;
      const auto slot = static_cast<std::size_t>(corner.count++);
      corner.vertices[slot] = vertex;
      corner.weights[slot] = point.weights[i];
      corner.position += point.weights[i] * mesh_.positions.row(vertex);
    }
    return corner;
  }

  bool LiesOn(const Corner& corner, VertexIndex face) const {
    for (int i = 0; i < corner.count; ++i) {
      if (CornerOf(face, corner.vertices[static_cast<std::size_t>(i)]) < 0) {
        return false;
      }
    }
    return true;
  }

  // The textured faces on which the corner lies.
  std::vector<VertexIndex> FacesAt(const Corner& corner) const {
    std::vector<VertexIndex> faces;
    for (const VertexIndex face : stars_.Faces(corner.vertices[0])) {
      if (IsTextured(face) && LiesOn(corner, face)) faces.push_back(face);
    }
    return faces;
  }

  // REQUIRES: LiesOn(corner, face).
  Coordinates CoordinatesOn(const Corner& corner, VertexIndex face) const {
    Coordinates coordinates = Coordinates::Zero();
    for (int i = 0; i < corner.count; ++i) {
      const auto slot = static_cast<std::size_t>(i);
      coordinates += corner.weights[slot] *
                     CoordinatesOf(face, CornerOf(face, corner.vertices[slot]));
    }
    return coordinates;
  }

  Coordinates CoordinatesOn(const SurfacePoint& point) const {
    Coordinates coordinates = Coordinates::Zero();
    for (int i = 0; i < 3; ++i) {
      coordinates += point.weights[i] * CoordinatesOf(point.face, i);
    }
    return coordinates;
  }

 private:
  Coordinates CoordinatesOf(VertexIndex face, int corner) const {
    return texture_.coordinates.row(texture_.corners(face, corner));
  }
  int CornerOf(VertexIndex face, VertexIndex vertex) const {
    for (int i = 0; i < 3; ++i) {
      if (mesh_.faces(face, i) == vertex) return i;
    }
    return -1;
  }

  const MeshTexture& texture_;
  const TriangleMesh mesh_;
  const EdgeFaces edges_;
  const VertexStars stars_;
  VertexMap welded_from_y_;
};

// What one face of X gets.
struct FaceTexture {
  bool has_texture = false;
  bool is_on_seam = false;
  FaceCorners coordinates;
  int material = -1;
};

// Carries texture coordinates to faces of X, one after the other. Not
// thread-safe.
class FaceCarrier {
 public:
  explicit FaceCarrier(const TexturedSurface& surface) : surface_(surface) {}

  FaceTexture Carry(const std::array<const PrecisePoint*, 3>& points) {
    for (std::size_t i = 0; i < 3; ++i) {
      const std::optional<Corner> corner = surface_.ToCorner(*points[i]);
      if (!corner) return {};
      corners_[i] = *corner;
    }
    const std::optional<Sheet> sheet = BestSheet();
    return sheet ? FromSheet(*sheet) : FaceTexture{};
  }

 private:
  // Faces of Y where corners lie, those of most corners first.
  std::vector<VertexIndex> Roots() const {
    std::vector<std::pair<int, VertexIndex>> roots;
    for (const Corner& corner : corners_) {
      for (const VertexIndex face : surface_.FacesAt(corner)) {
        const auto lies_on_face = [&](const Corner& other) {
          return surface_.LiesOn(other, face);
        };
        roots.emplace_back(
            -std::count_if(corners_.begin(), corners_.end(), lies_on_face),
            face);
      }
    }
    std::stable_sort(
        roots.begin(), roots.end(),
        [](const auto& a, const auto& b) { return a.first < b.first; });
    std::vector<VertexIndex> faces;
    faces.reserve(roots.size());
    for (const auto& [count, face] : roots) faces.push_back(face);
    return faces;
  }

  std::optional<Sheet> BestSheet() {
    SetReach();
    std::optional<Sheet> best;
    double best_gap = 0;
    std::vector<VertexIndex> visited;
    for (const VertexIndex root : Roots()) {
      if (std::find(visited.begin(), visited.end(), root) != visited.end()) {
        continue;
      }
      Sheet sheet = Visit(root, Seams::kStop, kAnyDepth);
      // Without a seam about there is nothing to choose.
      if (sheet.met == 3 && (sheet.depth == 0 || !sheet.has_seam)) return sheet;
      const int most = MostDepth(root);
      if (sheet.depth > most) sheet = Visit(root, Seams::kStop, most);
      visited.insert(visited.end(), sheet.faces.begin(), sheet.faces.end());
      const double gap = GapOf(sheet);
      if (!best || std::tuple(-sheet.met, gap, sheet.depth) <
                       std::tuple(-best->met, best_gap, best->depth)) {
        best = std::move(sheet);
        best_gap = gap;
      }
    }
    return best;
  }

  enum class Seams { kStop, kCross };

  // Returns how many edges a way that avoids seams may have: not many more than
  // the way across them, so that none goes around a limb.
  int MostDepth(VertexIndex root) {
    const int direct = Visit(root, Seams::kCross, kAnyDepth).depth;
    return static_cast<int>(kDetour * direct) + kDetourEdges;
  }

  // Breadth first from `root` until all corners are met, or as far as the face
  // of X reaches, over `most_depth` edges at most.
  Sheet Visit(VertexIndex root, Seams seams, int most_depth) {
    Sheet sheet;
    sheet.faces.push_back(root);
    depth_of_.clear();
    depth_of_[root] = 0;
    for (std::size_t i = 0; i < sheet.faces.size(); ++i) {
      const VertexIndex face = sheet.faces[i];
      Meet(face, sheet);
      if (sheet.met == 3 || sheet.faces.size() > kMostFaces) break;
      for (int corner = 0; corner < 3; ++corner) {
        const VertexIndex next = seams == Seams::kStop
                                     ? surface_.Beyond(face, corner)
                                     : surface_.Across(face, corner);
        sheet.has_seam |= next == kNoVertex;
        const int depth = depth_of_[face] + 1;
        if (next == kNoVertex || depth > most_depth || !IsWithinReach(next)) {
          continue;
        }
        if (depth_of_.emplace(next, depth).second) {
          sheet.faces.push_back(next);
        }
      }
    }
    return sheet;
  }

  void Meet(VertexIndex face, Sheet& sheet) const {
    for (std::size_t i = 0; i < 3; ++i) {
      if (sheet.face_of_corner[i] != kNoVertex) continue;
      if (!surface_.LiesOn(corners_[i], face)) continue;
      sheet.face_of_corner[i] = face;
      sheet.depth = depth_of_.at(face);
      ++sheet.met;
    }
  }

  void SetReach() {
    middle_ =
        (corners_[0].position + corners_[1].position + corners_[2].position) /
        3;
    reach_ = 0;
    for (const Corner& corner : corners_) {
      reach_ = std::max(reach_, kReach * (corner.position - middle_).norm());
    }
  }

  // False only for faces that are farther than the reach.
  bool IsWithinReach(VertexIndex face) const {
    const TriangleMesh& mesh = surface_.mesh();
    const auto position = [&](int i) {
      return mesh.positions.row(mesh.faces(face, i));
    };
    const Eigen::RowVector3d center =
        (position(0) + position(1) + position(2)) / 3;
    double radius = 0;
    for (int i = 0; i < 3; ++i) {
      radius = std::max(radius, (position(i) - center).norm());
    }
    return (center - middle_).norm() <= reach_ + radius;
  }

  SurfacePoint NearestOn(const Sheet& sheet, const Corner& corner) const {
    return NearestOnFaces(surface_.mesh(), sheet.faces, corner.position);
  }

  // Sum of the distances from the sheet to the corners that are not on it.
  double GapOf(const Sheet& sheet) const {
    double gap = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      if (sheet.face_of_corner[i] != kNoVertex) continue;
      gap += (PositionOf(surface_.mesh(), NearestOn(sheet, corners_[i])) -
              corners_[i].position)
                 .norm();
    }
    return gap;
  }

  FaceTexture FromSheet(const Sheet& sheet) const {
    FaceTexture face;
    face.has_texture = true;
    face.is_on_seam = sheet.met < 3;
    face.material = surface_.MaterialOf(sheet.faces[0]);
    for (std::size_t i = 0; i < 3; ++i) {
      const VertexIndex met = sheet.face_of_corner[i];
      face.coordinates[i] =
          met != kNoVertex
              ? surface_.CoordinatesOn(corners_[i], met)
              : surface_.CoordinatesOn(NearestOn(sheet, corners_[i]));
    }
    return face;
  }

  const TexturedSurface& surface_;
  std::array<Corner, 3> corners_;
  std::unordered_map<VertexIndex, int> depth_of_;
  Eigen::RowVector3d middle_ = Eigen::RowVector3d::Zero();
  double reach_ = 0;
};

absl::Status CarryFaces(const Faces& faces_x, const TexturedSurface& surface,
                        absl::Span<const PrecisePoint> places,
                        const std::stop_token& stop,
                        std::vector<FaceTexture>* found) {
  constexpr std::int64_t kPerTask = 1024;
  const std::int64_t tasks = (faces_x.rows() + kPerTask - 1) / kPerTask;
  return ParallelFor(tasks, stop, [&](std::int64_t task) {
    FaceCarrier carrier(surface);
    const std::int64_t end =
        std::min<std::int64_t>(faces_x.rows(), (task + 1) * kPerTask);
    for (std::int64_t f = task * kPerTask; f < end; ++f) {
      if (stop.stop_requested()) return;
      (*found)[static_cast<std::size_t>(f)] =
          carrier.Carry({&places[static_cast<std::size_t>(faces_x(f, 0))],
                         &places[static_cast<std::size_t>(faces_x(f, 1))],
                         &places[static_cast<std::size_t>(faces_x(f, 2))]});
    }
  });
}

// Gives each vertex one row for each of the coordinates its faces have for it.
class CoordinateNumbers {
 public:
  explicit CoordinateNumbers(VertexIndex vertices)
      : rows_of_(static_cast<std::size_t>(vertices)) {}

  VertexIndex NumberOf(VertexIndex vertex, const Coordinates& coordinates) {
    std::vector<VertexIndex>& rows = rows_of_[static_cast<std::size_t>(vertex)];
    for (const VertexIndex row : rows) {
      if (coordinates_[static_cast<std::size_t>(row)] == coordinates)
        return row;
    }
    rows.push_back(static_cast<VertexIndex>(coordinates_.size()));
    coordinates_.push_back(coordinates);
    return rows.back();
  }

  MeshTexture::Coordinates All() const {
    MeshTexture::Coordinates all(static_cast<Eigen::Index>(coordinates_.size()),
                                 2);
    for (std::size_t i = 0; i < coordinates_.size(); ++i) {
      all.row(static_cast<Eigen::Index>(i)) = coordinates_[i];
    }
    return all;
  }

 private:
  std::vector<std::vector<VertexIndex>> rows_of_;
  std::vector<Coordinates> coordinates_;
};

}  // namespace

absl::StatusOr<CarriedTexture> CarryTexture(
    const TriangleMesh& mesh_x, const TriangleMesh& mesh_y,
    const MeshTexture& texture_y, absl::Span<const PrecisePoint> places,
    const std::stop_token& stop) {
  const TexturedSurface surface(mesh_y, texture_y);
  std::vector<FaceTexture> found(static_cast<std::size_t>(mesh_x.num_faces()));
  ISOMATCH_RETURN_IF_ERROR(
      CarryFaces(mesh_x.faces, surface, places, stop, &found));
  CarriedTexture carried;
  MeshTexture& texture = carried.texture;
  texture.materials = texture_y.materials;
  texture.images = texture_y.images;
  texture.image_of_material = texture_y.image_of_material;
  texture.libraries = texture_y.libraries;
  texture.corners = Faces::Constant(mesh_x.num_faces(), 3, -1);
  CoordinateNumbers numbers(mesh_x.num_vertices());
  for (VertexIndex f = 0; f < mesh_x.num_faces(); ++f) {
    const FaceTexture& face = found[static_cast<std::size_t>(f)];
    carried.faces_without += !face.has_texture;
    carried.faces_on_seams += face.is_on_seam;
    texture.material_of_face.push_back(face.material);
    for (int i = 0; i < 3 && face.has_texture; ++i) {
      texture.corners(f, i) = numbers.NumberOf(
          mesh_x.faces(f, i), face.coordinates[static_cast<std::size_t>(i)]);
    }
  }
  texture.coordinates = numbers.All();
  return carried;
}

}  // namespace isomatch
