#include "tests/support/extreme_meshes.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/random_stream.h"
#include "tests/support/dirty_meshes.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

/// The largest and smallest magnitudes of single precision, as exponents.
constexpr double kLargest = 38.3;
constexpr double kSmallest = -44.5;
constexpr double kMost = 3.3e38;

/// Chances, each an amount of the one stream.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : random_(seed, /*stream=*/0) {}

  int Below(int end) { return static_cast<int>(random_.Below(end)); }
  double Between(double low, double high) {
    return low + (high - low) * random_.Unit();
  }
  bool OneIn(int n) { return Below(n) == 0; }
  /// Of either sign, its magnitude by even chances of the exponent.
  double Magnitude(double low, double high) {
    return (OneIn(2) ? -1 : 1) * std::pow(10.0, Between(low, high));
  }
  Eigen::RowVector3d Point() {
    return {Between(-1, 1), Between(-1, 1), Between(-1, 1)};
  }

 private:
  RandomStream random_;
};

/// Grows or shrinks with the dice: mostly small, so that many fit in a minute.
TriangleMesh AnySurface(Dice& dice) {
  const int levels = dice.OneIn(40) ? 4 : 1 + dice.Below(2);
  switch (dice.Below(6)) {
    case 0:
      return BumpySphere(levels);
    case 1:
      return FiveArms(levels);
    case 2:
      return PlaneGrid(1 + dice.Below(40), 1 + dice.Below(8),
                       std::pow(10.0, dice.Between(-3, 6)), 1);
    case 3:
      return Torus(3 + dice.Below(30), 3 + dice.Below(12));
    case 4:
      return UnitSphere(levels);
    default:
      return Tetrahedron();
  }
}

TriangleMesh AnyMesh(Dice& dice, std::string* description) {
  const int large = dice.OneIn(40) ? 10 : 1;
  const int size = 3 + dice.Below(300 * large);
  const auto named = [&](const char* name, TriangleMesh mesh) {
    *description = name;
    return mesh;
  };
  switch (dice.Below(8)) {
    case 0:
      return named("fan", Fan(size));
    case 1:
      return named("book", Book(size));
    case 2:
      return named("any faces", AnyFaces(3 + dice.Below(200)));
    case 3:
      return named("soup", TriangleSoup(Untouched(AnySurface(dice))).mesh);
    default:
      return named("surface", AnySurface(dice));
  }
}

using Damage = std::function<void(Dice&, TriangleMesh&)>;

struct NamedDamage {
  const char* name;
  Damage apply;
};

DirtyMesh Dirty(const TriangleMesh& mesh) { return Untouched(mesh); }

const std::vector<NamedDamage>& Damages() {
  static const auto* const damages = new std::vector<NamedDamage>{
      {"one vertex far",
       [](Dice& dice, TriangleMesh& mesh) {
         mesh.positions.row(dice.Below(mesh.num_vertices())) =
             dice.Point() * dice.Magnitude(1, kLargest);
       }},
      {"some vertices scaled",
       [](Dice& dice, TriangleMesh& mesh) {
         const double scale = dice.Magnitude(kSmallest, kLargest);
         for (int i = 1 + dice.Below(20); i > 0; --i) {
           mesh.positions.row(dice.Below(mesh.num_vertices())) *= scale;
         }
       }},
      {"all scaled",
       [](Dice& dice, TriangleMesh& mesh) {
         mesh.positions *= dice.Magnitude(kSmallest, kLargest);
       }},
      {"axes scaled",
       [](Dice& dice, TriangleMesh& mesh) {
         const double most = dice.OneIn(2) ? 8 : kLargest;
         for (int axis = 0; axis < 3; ++axis) {
           mesh.positions.col(axis) *= dice.Magnitude(-most, most);
         }
       }},
      {"each vertex scaled",
       [](Dice& dice, TriangleMesh& mesh) {
         const double most = dice.Between(0, kLargest);
         for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
           mesh.positions.row(v) *= dice.Magnitude(-most, most);
         }
       }},
      {"each coordinate anything",
       [](Dice& dice, TriangleMesh& mesh) {
         for (double& value : mesh.positions.reshaped()) {
           value = dice.Magnitude(kSmallest, kLargest);
         }
       }},
      {"moved",
       [](Dice& dice, TriangleMesh& mesh) {
         mesh.positions.col(dice.Below(3)).array() +=
             dice.Magnitude(0, kLargest);
       }},
      {"an axis flat",
       [](Dice& dice, TriangleMesh& mesh) {
         mesh.positions.col(dice.Below(3)).setZero();
       }},
      {"vertices coincide",
       [](Dice& dice, TriangleMesh& mesh) {
         const VertexIndex n = mesh.num_vertices();
         for (int i = 1 + dice.Below(n); i > 0; --i) {
           mesh.positions.row(dice.Below(n)) =
               mesh.positions.row(dice.Below(n));
         }
       }},
      {"noise",
       [](Dice& dice, TriangleMesh& mesh) {
         const double size = std::abs(dice.Magnitude(-8, 2));
         for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
           mesh.positions.row(v) += size * dice.Point();
         }
       }},
      {"faces between anything",
       [](Dice& dice, TriangleMesh& mesh) {
         for (int i = 1 + dice.Below(mesh.num_faces()); i > 0; --i) {
           mesh.faces(dice.Below(mesh.num_faces()), dice.Below(3)) =
               dice.Below(mesh.num_vertices());
         }
       }},
      {"fins",
       [](Dice& dice, TriangleMesh& mesh) {
         mesh = WithFins(Dirty(mesh), AtRandom(.1, dice.Below(1000))).mesh;
       }},
      {"slivers",
       [](Dice& dice, TriangleMesh& mesh) {
         mesh = WithSlivers(Dirty(mesh), AtRandom(.3, dice.Below(1000)),
                            std::abs(dice.Magnitude(-12, 0)))
                    .mesh;
       }},
      {"collapsed edges",
       [](Dice& dice, TriangleMesh& mesh) {
         mesh = WithCollapsedEdges(Dirty(mesh), AtRandom(.3, dice.Below(1000)))
                    .mesh;
       }},
      {"holes",
       [](Dice& dice, TriangleMesh& mesh) {
         mesh = WithoutFaces(Dirty(mesh), AtRandom(.5, dice.Below(1000))).mesh;
       }},
      {"faces turned and repeated",
       [](Dice& dice, TriangleMesh& mesh) {
         const auto some = AtRandom(.3, dice.Below(1000));
         mesh =
             WithRepeatedFaces(WithFlippedFaces(Dirty(mesh), some), some).mesh;
       }},
      {"touching tetrahedra", [](Dice& dice, TriangleMesh& mesh) {
         mesh = WithTouchingTetrahedra(Dirty(mesh),
                                       AtRandom(.05, dice.Below(1000)),
                                       std::abs(dice.Magnitude(-6, 6)))
                    .mesh;
       }}};
  return *damages;
}

void RoundToSingle(Positions* positions) {
  for (double& value : positions->reshaped()) {
    if (std::isnan(value)) value = 0;
    value = static_cast<float>(std::clamp(value, -kMost, kMost));
  }
}

}  // namespace

TriangleMesh Fan(VertexIndex faces) {
  TriangleMesh mesh{Positions::Zero(faces + 1, 3), Faces(faces, 3)};
  for (VertexIndex f = 0; f < faces; ++f) {
    const double angle = 2 * std::numbers::pi * f / faces;
    mesh.positions.row(f + 1) << std::cos(angle), std::sin(angle),
        0.3 * std::sin(5 * angle);
    mesh.faces.row(f) << 0, f + 1, (f + 1) % faces + 1;
  }
  return mesh;
}

TriangleMesh Book(VertexIndex pages) {
  TriangleMesh mesh{Positions::Zero(pages + 2, 3), Faces(pages, 3)};
  mesh.positions(1, 2) = 1;
  for (VertexIndex f = 0; f < pages; ++f) {
    const double angle = 2 * std::numbers::pi * f / pages;
    mesh.positions.row(f + 2) << std::cos(angle), std::sin(angle), 0.5;
    mesh.faces.row(f) << 0, 1, f + 2;
  }
  return mesh;
}

ExtremeMesh RandomExtremeMesh(std::uint64_t seed) {
  Dice dice(seed);
  ExtremeMesh extreme;
  extreme.mesh = AnyMesh(dice, &extreme.description);
  for (int i = dice.Below(4); i > 0; --i) {
    const NamedDamage& damage =
        Damages()[dice.Below(static_cast<int>(Damages().size()))];
    if (extreme.mesh.num_faces() == 0) break;
    damage.apply(dice, extreme.mesh);
    absl::StrAppend(&extreme.description, ", ", damage.name);
  }
  RoundToSingle(&extreme.mesh.positions);
  return extreme;
}

}  // namespace isomatch
