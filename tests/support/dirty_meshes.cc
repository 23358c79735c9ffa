#include "tests/support/dirty_meshes.h"

#include <map>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "core/base/random_stream.h"
#include "core/mesh/mesh_geometry.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

/// Grows a copy of a mesh.
class Builder {
 public:
  /// Begins with the vertices of `dirty` and none of its faces.
  explicit Builder(const DirtyMesh& dirty) : origin_(dirty.origin) {
    for (VertexIndex v = 0; v < dirty.mesh.num_vertices(); ++v) {
      positions_.push_back(dirty.mesh.positions.row(v));
    }
  }
  Builder() = default;

  VertexIndex AddVertex(const Eigen::RowVector3d& position,
                        VertexIndex origin) {
    positions_.push_back(position);
    origin_.push_back(origin);
    return static_cast<VertexIndex>(positions_.size()) - 1;
  }
  void AddFace(VertexIndex a, VertexIndex b, VertexIndex c) {
    faces_.emplace_back(a, b, c);
  }
  const Eigen::RowVector3d& position(VertexIndex v) const {
    return positions_[v];
  }
  VertexIndex origin(VertexIndex v) const { return origin_[v]; }
  void Move(VertexIndex v, const Eigen::RowVector3d& to) { positions_[v] = to; }

  DirtyMesh Finish() const {
    DirtyMesh result;
    result.origin = origin_;
    result.mesh.positions.resize(positions_.size(), 3);
    for (std::size_t v = 0; v < positions_.size(); ++v) {
      result.mesh.positions.row(v) = positions_[v];
    }
    result.mesh.faces.resize(faces_.size(), 3);
    for (std::size_t f = 0; f < faces_.size(); ++f) {
      result.mesh.faces.row(f) = faces_[f];
    }
    return result;
  }

 private:
  std::vector<Eigen::RowVector3d> positions_;
  VertexMap origin_;
  std::vector<Eigen::Matrix<VertexIndex, 1, 3>> faces_;
};

/// The corners of a face.
struct Corners {
  Corners(const TriangleMesh& mesh, VertexIndex face)
      : a(mesh.faces(face, 0)),
        b(mesh.faces(face, 1)),
        c(mesh.faces(face, 2)) {}
  VertexIndex a, b, c;
};

Eigen::RowVector3d Middle(const TriangleMesh& mesh, VertexIndex face) {
  return (mesh.positions.row(mesh.faces(face, 0)) +
          mesh.positions.row(mesh.faces(face, 1)) +
          mesh.positions.row(mesh.faces(face, 2))) /
         3;
}

/// Unit normal of a face.
Eigen::RowVector3d Normal(const TriangleMesh& mesh, VertexIndex face) {
  const Corners f(mesh, face);
  const Eigen::Vector3d ab = mesh.positions.row(f.b) - mesh.positions.row(f.a);
  const Eigen::Vector3d ac = mesh.positions.row(f.c) - mesh.positions.row(f.a);
  return ab.cross(ac).normalized().transpose();
}

/// Rebuilds a mesh face by face: `rebuild(face, corners, builder)` adds what
/// takes the place of each.
template <typename Rebuild>
DirtyMesh FaceByFace(const DirtyMesh& dirty, const Rebuild& rebuild) {
  Builder builder(dirty);
  for (VertexIndex f = 0; f < dirty.mesh.num_faces(); ++f) {
    rebuild(f, Corners(dirty.mesh, f), &builder);
  }
  return builder.Finish();
}

}  // namespace

FacePredicate AtRandom(double fraction, std::uint64_t seed) {
  return [=](const TriangleMesh&, VertexIndex face) {
    return RandomStream(seed, face).Unit() < fraction;
  };
}

FacePredicate Beyond(const Eigen::RowVector3d& direction, double height) {
  return [=, unit = direction.normalized().eval()](const TriangleMesh& mesh,
                                                   VertexIndex face) {
    return Middle(mesh, face).dot(unit) > height;
  };
}

DirtyMesh Untouched(const TriangleMesh& mesh) {
  DirtyMesh result{mesh, VertexMap(mesh.num_vertices())};
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) result.origin[v] = v;
  return result;
}

DirtyMesh WithoutFaces(const DirtyMesh& dirty, const FacePredicate& remove) {
  DirtyMesh result =
      FaceByFace(dirty, [&](VertexIndex f, Corners at, Builder* builder) {
        if (!remove(dirty.mesh, f)) builder->AddFace(at.a, at.b, at.c);
      });
  std::vector<char> on_face(result.origin.size(), false);
  for (Eigen::Index i = 0; i < result.mesh.faces.size(); ++i) {
    on_face[result.mesh.faces.data()[i]] = true;
  }
  for (std::size_t v = 0; v < on_face.size(); ++v) {
    if (!on_face[v]) result.origin[v] = kNoVertex;
  }
  return result;
}

DirtyMesh WithoutLoneVertices(const DirtyMesh& dirty) {
  Builder builder;
  VertexMap new_from_old(dirty.origin.size(), kNoVertex);
  for (std::size_t v = 0; v < dirty.origin.size(); ++v) {
    if (dirty.origin[v] == kNoVertex) continue;
    new_from_old[v] =
        builder.AddVertex(dirty.mesh.positions.row(v), dirty.origin[v]);
  }
  for (VertexIndex f = 0; f < dirty.mesh.num_faces(); ++f) {
    const Corners at(dirty.mesh, f);
    builder.AddFace(new_from_old[at.a], new_from_old[at.b], new_from_old[at.c]);
  }
  return builder.Finish();
}

DirtyMesh MovedPart(const TriangleMesh& whole, const FacePredicate& remove,
                    std::uint64_t seed, double scale) {
  DirtyMesh part = WithoutLoneVertices(WithoutFaces(Untouched(whole), remove));
  const auto permutation = RandomPermutation(part.mesh.num_vertices(), seed);
  part.mesh = Moved(Relabeled(part.mesh, permutation), scale);
  VertexMap origin(part.origin.size());
  for (std::size_t v = 0; v < origin.size(); ++v) {
    origin[permutation[v]] = part.origin[v];
  }
  part.origin = origin;
  return part;
}

DirtyMesh WithFlippedFaces(const DirtyMesh& dirty, const FacePredicate& flip) {
  return FaceByFace(dirty, [&](VertexIndex f, Corners at, Builder* builder) {
    if (flip(dirty.mesh, f)) std::swap(at.b, at.c);
    builder->AddFace(at.a, at.b, at.c);
  });
}

DirtyMesh TriangleSoup(const DirtyMesh& dirty) {
  Builder builder;
  const auto copy = [&](VertexIndex v) {
    return builder.AddVertex(dirty.mesh.positions.row(v), dirty.origin[v]);
  };
  for (VertexIndex f = 0; f < dirty.mesh.num_faces(); ++f) {
    const Corners at(dirty.mesh, f);
    const VertexIndex a = copy(at.a);
    const VertexIndex b = copy(at.b);
    const VertexIndex c = copy(at.c);
    builder.AddFace(a, b, c);
  }
  return builder.Finish();
}

DirtyMesh WithRepeatedFaces(const DirtyMesh& dirty,
                            const FacePredicate& repeat) {
  int repeated = 0;
  return FaceByFace(dirty, [&](VertexIndex f, Corners at, Builder* builder) {
    builder->AddFace(at.a, at.b, at.c);
    if (!repeat(dirty.mesh, f)) return;
    switch (repeated++ % 3) {
      case 0:
        return builder->AddFace(at.a, at.b, at.c);
      case 1:
        return builder->AddFace(at.b, at.c, at.a);
      default:
        return builder->AddFace(at.c, at.b, at.a);
    }
  });
}

DirtyMesh WithLoneVertices(const DirtyMesh& dirty, VertexIndex count) {
  Builder builder;
  const VertexIndex first = (count + 1) / 2;
  const auto lone = [&](VertexIndex v) {
    builder.AddVertex(Eigen::RowVector3d(50 + v, 50, -70), kNoVertex);
  };
  for (VertexIndex v = 0; v < first; ++v) lone(v);
  for (VertexIndex v = 0; v < dirty.mesh.num_vertices(); ++v) {
    builder.AddVertex(dirty.mesh.positions.row(v), dirty.origin[v]);
  }
  for (VertexIndex v = first; v < count; ++v) lone(v);
  for (VertexIndex f = 0; f < dirty.mesh.num_faces(); ++f) {
    const Corners at(dirty.mesh, f);
    builder.AddFace(at.a + first, at.b + first, at.c + first);
  }
  return builder.Finish();
}

DirtyMesh WithFins(const DirtyMesh& dirty, const FacePredicate& at_face) {
  const double length = MeanEdgeLength(dirty.mesh);
  return FaceByFace(dirty, [&](VertexIndex f, Corners at, Builder* builder) {
    builder->AddFace(at.a, at.b, at.c);
    if (!at_face(dirty.mesh, f)) return;
    const Eigen::RowVector3d foot =
        (builder->position(at.a) + builder->position(at.b)) / 2;
    const VertexIndex tip = builder->AddVertex(
        foot + length * Normal(dirty.mesh, f), builder->origin(at.a));
    builder->AddFace(at.a, at.b, tip);
  });
}

DirtyMesh WithTouchingTetrahedra(const DirtyMesh& dirty,
                                 const FacePredicate& at_face, double size) {
  return FaceByFace(dirty, [&](VertexIndex f, Corners at, Builder* builder) {
    builder->AddFace(at.a, at.b, at.c);
    if (!at_face(dirty.mesh, f)) return;
    const Eigen::RowVector3d foot = builder->position(at.a);
    const Eigen::RowVector3d up = size * Normal(dirty.mesh, f);
    const Eigen::RowVector3d along =
        size * (builder->position(at.b) - foot).normalized();
    const Eigen::RowVector3d across =
        Eigen::Vector3d(up).cross(Eigen::Vector3d(along)).transpose() / size;
    const VertexIndex origin = builder->origin(at.a);
    const VertexIndex b = builder->AddVertex(foot + up + 0.5 * along, origin);
    const VertexIndex c =
        builder->AddVertex(foot + up - 0.3 * along + 0.4 * across, origin);
    const VertexIndex d =
        builder->AddVertex(foot + up - 0.3 * along - 0.4 * across, origin);
    builder->AddFace(at.a, c, b);
    builder->AddFace(at.a, d, c);
    builder->AddFace(at.a, b, d);
    builder->AddFace(b, c, d);
  });
}

DirtyMesh WithRepeatedCorners(const DirtyMesh& dirty,
                              const FacePredicate& at_face) {
  int added = 0;
  return FaceByFace(dirty, [&](VertexIndex f, Corners at, Builder* builder) {
    builder->AddFace(at.a, at.b, at.c);
    if (!at_face(dirty.mesh, f)) return;
    switch (added++ % 3) {
      case 0:
        return builder->AddFace(at.a, at.a, at.b);
      case 1:
        return builder->AddFace(at.a, at.b, at.a);
      default:
        return builder->AddFace(at.c, at.c, at.c);
    }
  });
}

DirtyMesh WithFlatFaces(const DirtyMesh& dirty, const FacePredicate& at_face) {
  return FaceByFace(dirty, [&](VertexIndex f, Corners at, Builder* builder) {
    if (!at_face(dirty.mesh, f)) return builder->AddFace(at.a, at.b, at.c);
    const VertexIndex middle = builder->AddVertex(
        (builder->position(at.a) + builder->position(at.b)) / 2,
        builder->origin(at.a));
    builder->AddFace(at.a, middle, at.c);
    builder->AddFace(middle, at.b, at.c);
    builder->AddFace(at.a, at.b, middle);
  });
}

DirtyMesh WithSlivers(const DirtyMesh& dirty, const FacePredicate& at_face,
                      double offset) {
  return FaceByFace(dirty, [&](VertexIndex f, Corners at, Builder* builder) {
    if (!at_face(dirty.mesh, f)) return builder->AddFace(at.a, at.b, at.c);
    const Eigen::RowVector3d corner = builder->position(at.a);
    const VertexIndex inner =
        builder->AddVertex(corner + offset * (Middle(dirty.mesh, f) - corner),
                           builder->origin(at.a));
    builder->AddFace(at.a, at.b, inner);
    builder->AddFace(at.b, at.c, inner);
    builder->AddFace(at.c, at.a, inner);
  });
}

DirtyMesh WithCollapsedEdges(const DirtyMesh& dirty,
                             const FacePredicate& at_face) {
  return FaceByFace(dirty, [&](VertexIndex f, Corners at, Builder* builder) {
    builder->AddFace(at.a, at.b, at.c);
    if (!at_face(dirty.mesh, f)) return;
    builder->Move(at.a, dirty.mesh.positions.row(at.b));
  });
}

DirtyMesh Refined(const DirtyMesh& dirty, const FacePredicate& refine) {
  using Edge = std::pair<VertexIndex, VertexIndex>;
  const auto edge = [](VertexIndex a, VertexIndex b) -> Edge {
    return std::minmax(a, b);
  };
  Builder builder(dirty);
  std::map<Edge, VertexIndex> middles;
  const auto cut = [&](VertexIndex a, VertexIndex b) {
    const auto [it, is_new] = middles.try_emplace(edge(a, b), kNoVertex);
    if (!is_new) return;
    it->second = builder.AddVertex(
        (builder.position(a) + builder.position(b)) / 2, builder.origin(a));
  };
  for (VertexIndex f = 0; f < dirty.mesh.num_faces(); ++f) {
    if (!refine(dirty.mesh, f)) continue;
    const Corners at(dirty.mesh, f);
    cut(at.a, at.b);
    cut(at.b, at.c);
    cut(at.c, at.a);
  }
  const auto middle = [&](VertexIndex a, VertexIndex b) {
    const auto it = middles.find(edge(a, b));
    return it == middles.end() ? kNoVertex : it->second;
  };
  for (VertexIndex f = 0; f < dirty.mesh.num_faces(); ++f) {
    Corners at(dirty.mesh, f);
    // Rotate until the first side is cut and the last is not, if any is not.
    for (int turn = 0; turn < 3; ++turn) {
      if (middle(at.a, at.b) != kNoVertex && middle(at.c, at.a) == kNoVertex) {
        break;
      }
      at = [&] {
        Corners turned = at;
        turned.a = at.b;
        turned.b = at.c;
        turned.c = at.a;
        return turned;
      }();
    }
    const VertexIndex ab = middle(at.a, at.b);
    const VertexIndex bc = middle(at.b, at.c);
    const VertexIndex ca = middle(at.c, at.a);
    if (ab == kNoVertex) {
      builder.AddFace(at.a, at.b, at.c);
    } else if (bc == kNoVertex) {
      builder.AddFace(at.a, ab, at.c);
      builder.AddFace(ab, at.b, at.c);
    } else if (ca == kNoVertex) {
      builder.AddFace(at.a, ab, at.c);
      builder.AddFace(ab, bc, at.c);
      builder.AddFace(ab, at.b, bc);
    } else {
      builder.AddFace(at.a, ab, ca);
      builder.AddFace(ab, at.b, bc);
      builder.AddFace(ca, bc, at.c);
      builder.AddFace(ab, bc, ca);
    }
  }
  return builder.Finish();
}

DirtyMesh Joined(const DirtyMesh& a, const DirtyMesh& b,
                 VertexIndex origins_of_a) {
  DirtyMesh result = a;
  const VertexIndex vertices = a.mesh.num_vertices();
  result.mesh.positions.conservativeResize(vertices + b.mesh.num_vertices(), 3);
  result.mesh.positions.bottomRows(b.mesh.num_vertices()) = b.mesh.positions;
  const VertexIndex faces = a.mesh.num_faces();
  result.mesh.faces.conservativeResize(faces + b.mesh.num_faces(), 3);
  result.mesh.faces.bottomRows(b.mesh.num_faces()) =
      (b.mesh.faces.array() + vertices).matrix();
  for (const VertexIndex v : b.origin) {
    result.origin.push_back(v == kNoVertex ? kNoVertex : v + origins_of_a);
  }
  return result;
}

TriangleMesh Shifted(const TriangleMesh& mesh, double by) {
  const double extent = (mesh.positions.colwise().maxCoeff() -
                         mesh.positions.colwise().minCoeff())
                            .maxCoeff();
  TriangleMesh result = mesh;
  result.positions.rowwise() +=
      by * extent * Eigen::RowVector3d(0.6, -0.48, 0.64);
  return result;
}

}  // namespace isomatch
