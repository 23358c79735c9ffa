#include "core/geodesic/wavefront_stencils.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Core>

#include "core/mesh/topology.h"

namespace isomatch {
namespace {

/// Triangles unfolded behind an obtuse angle before giving up.
constexpr int kMaxUnfolded = 10;

struct SupportedStencil {
  VertexIndex support;
  WavefrontStencil stencil;
};

/// A vertex laid into the plane of the angle that is being split.
struct PlanarVertex {
  VertexIndex vertex;
  Eigen::Vector2d position;
};

/// Third corner of a triangle with two corners at `p` and `q` and lengths
/// `from_p`, `from_q` to them, on the other side of pq than `behind`.
Eigen::Vector2d UnfoldAcross(const Eigen::Vector2d& p, const Eigen::Vector2d& q,
                             double from_p, double from_q,
                             const Eigen::Vector2d& behind) {
  const double length = (q - p).norm();
  const Eigen::Vector2d along = (q - p) / length;
  Eigen::Vector2d normal(-along.y(), along.x());
  if (normal.dot(behind - p) > 0) normal = -normal;
  const double t =
      (from_p * from_p - from_q * from_q + length * length) / (2 * length);
  const double height = std::sqrt(std::max(0.0, from_p * from_p - t * t));
  return p + t * along + height * normal;
}

class StencilBuilder {
 public:
  explicit StencilBuilder(const TriangleMesh& mesh)
      : mesh_(mesh), edges_(mesh.faces) {
    stencils_.reserve(static_cast<std::size_t>(mesh.num_faces()) * 7);
    for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
      for (int corner = 0; corner < 3; ++corner) AddCorner(f, corner);
    }
  }

  const std::vector<SupportedStencil>& stencils() const { return stencils_; }

 private:
  double Length(VertexIndex a, VertexIndex b) const {
    return (mesh_.positions.row(a) - mesh_.positions.row(b)).norm();
  }

  /// Stencils of the vertex at `corner` over the opposite edge.
  void AddCorner(VertexIndex face, int corner) {
    const VertexIndex v = mesh_.faces(face, corner);
    const VertexIndex a = mesh_.faces(face, (corner + 1) % 3);
    const VertexIndex b = mesh_.faces(face, (corner + 2) % 3);
    const double va = Length(v, a);
    const double vb = Length(v, b);
    const double ab = Length(a, b);
    const bool obtuse = va * va + vb * vb < ab * ab;
    if (obtuse && AddUnfolded(face, corner, va, vb, ab)) return;
    AddPair({v, a, b, va, vb, ab});
  }

  /// Splits the obtuse angle at `corner`; false when no vertex behind the
  /// opposite edge does.
  bool AddUnfolded(VertexIndex face, int corner, double va, double vb,
                   double ab) {
    const VertexIndex v = mesh_.faces(face, corner);
    const PlanarVertex a = {mesh_.faces(face, (corner + 1) % 3), {0, 0}};
    const PlanarVertex b = {mesh_.faces(face, (corner + 2) % 3), {ab, 0}};
    const double x = (va * va - vb * vb + ab * ab) / (2 * ab);
    const Eigen::Vector2d apex(x, std::sqrt(std::max(0.0, va * va - x * x)));
    const std::optional<PlanarVertex> split =
        FindSplit(edges_.Opposite(face, (corner + 1) % 3), apex, a, b);
    if (!split) return false;
    const double vw = (split->position - apex).norm();
    AddPair({v, a.vertex, split->vertex, va, vw, split->position.norm()});
    AddPair({v, split->vertex, b.vertex, vw, vb,
             (split->position - b.position).norm()});
    return true;
  }

  /// Unfolds from `side` away from `apex` until a vertex lies within a right
  /// angle of both legs of the angle a-apex-b.
  std::optional<PlanarVertex> FindSplit(EdgeFaces::Side side,
                                        const Eigen::Vector2d& apex,
                                        const PlanarVertex& a,
                                        const PlanarVertex& b) const {
    PlanarVertex p = a;
    PlanarVertex q = b;
    Eigen::Vector2d behind = apex;
    for (int i = 0; i < kMaxUnfolded && side.face != kNoVertex; ++i) {
      const int opposite_corner = (side.corner + 2) % 3;
      const VertexIndex w = mesh_.faces(side.face, opposite_corner);
      if ((q.position - p.position).squaredNorm() == 0) return std::nullopt;
      const PlanarVertex next = {
          w, UnfoldAcross(p.position, q.position, Length(p.vertex, w),
                          Length(q.vertex, w), behind)};
      const Eigen::Vector2d to_next = next.position - apex;
      const bool within_a = to_next.dot(a.position - apex) >= 0;
      const bool within_b = to_next.dot(b.position - apex) >= 0;
      if (within_a && within_b) return next;
      // Go on over the edge that the sector between the two right angles
      // crosses: p-next when next lies beyond it on b's side.
      const bool keep_p = !within_a;
      behind = keep_p ? q.position : p.position;
      const VertexIndex kept = keep_p ? p.vertex : q.vertex;
      (keep_p ? q : p) = next;
      side = SideBetween(side.face, kept, w);
    }
    return std::nullopt;
  }

  /// The side of the face across the edge between `u` and `w` of `face`.
  EdgeFaces::Side SideBetween(VertexIndex face, VertexIndex u,
                              VertexIndex w) const {
    for (int corner = 0; corner < 3; ++corner) {
      const VertexIndex from = mesh_.faces(face, corner);
      const VertexIndex to = mesh_.faces(face, (corner + 1) % 3);
      if ((from == u && to == w) || (from == w && to == u)) {
        return edges_.Opposite(face, corner);
      }
    }
    return {kNoVertex, 0};
  }

  /// A triangle with the vertex that a stencil is of, and its sides' lengths.
  struct Triangle {
    VertexIndex v;
    VertexIndex support;
    VertexIndex other;
    double to_support;
    double to_other;
    double base;
  };

  /// Either of the two other vertices supports one.
  void AddPair(const Triangle& t) {
    if (t.v == t.support || t.v == t.other || t.support == t.other) return;
    if (t.base == 0) return;
    Add(t);
    Add({t.v, t.other, t.support, t.to_other, t.to_support, t.base});
  }

  void Add(const Triangle& t) {
    const double x = (t.to_support * t.to_support - t.to_other * t.to_other +
                      t.base * t.base) /
                     (2 * t.base);
    const double y =
        std::sqrt(std::max(0.0, t.to_support * t.to_support - x * x));
    stencils_.push_back(
        {t.support,
         {t.v, t.other, static_cast<float>(t.base), static_cast<float>(x),
          static_cast<float>(y), static_cast<float>(t.to_support)}});
  }

  const TriangleMesh& mesh_;
  const EdgeFaces edges_;
  std::vector<SupportedStencil> stencils_;
};

}  // namespace

WavefrontStencils::WavefrontStencils(const TriangleMesh& mesh)
    : first_(mesh.num_vertices() + 1, 0) {
  const StencilBuilder builder(mesh);
  for (const SupportedStencil& s : builder.stencils()) ++first_[s.support + 1];
  for (std::size_t v = 1; v < first_.size(); ++v) first_[v] += first_[v - 1];
  stencils_.resize(builder.stencils().size());
  std::vector<std::int64_t> next(first_.begin(), first_.end() - 1);
  for (const SupportedStencil& s : builder.stencils()) {
    stencils_[next[s.support]++] = s.stencil;
  }
}

}  // namespace isomatch
