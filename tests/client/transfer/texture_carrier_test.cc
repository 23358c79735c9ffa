#include "client/transfer/texture_carrier.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <numeric>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/sample/sample_animal.h"
#include "client/sample/sample_texture.h"
#include "core/mesh/surface_point.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using Places = std::vector<PrecisePoint>;

Places AtVertices(const VertexMap& map) {
  Places places;
  for (const VertexIndex y : map) {
    places.push_back(y == kNoVertex ? PrecisePoint{}
                                    : PrecisePoint{{y, y, y}, {1, 0, 0}});
  }
  return places;
}

/// By the distance in space.
VertexMap NearestMap(const TriangleMesh& x, const TriangleMesh& y) {
  VertexMap map;
  for (VertexIndex v = 0; v < x.num_vertices(); ++v) {
    Eigen::Index nearest = 0;
    (y.positions.rowwise() - x.positions.row(v))
        .rowwise()
        .squaredNorm()
        .minCoeff(&nearest);
    map.push_back(static_cast<VertexIndex>(nearest));
  }
  return map;
}

Places NearestPlaces(const TriangleMesh& x, const TriangleMesh& y) {
  VertexMap faces(static_cast<std::size_t>(y.num_faces()));
  std::iota(faces.begin(), faces.end(), 0);
  Places places;
  for (VertexIndex v = 0; v < x.num_vertices(); ++v) {
    const SurfacePoint point = NearestOnFaces(y, faces, x.positions.row(v));
    PrecisePoint place;
    for (int i = 0; i < 3; ++i) {
      place.vertices[static_cast<std::size_t>(i)] = y.faces(point.face, i);
      place.weights[static_cast<std::size_t>(i)] = point.weights[i];
    }
    places.push_back(place);
  }
  return places;
}

Eigen::RowVector2d Corner(const MeshTexture& texture, VertexIndex face, int i) {
  return texture.coordinates.row(texture.corners(face, i));
}

/// Extent of a face in the picture along u.
double Width(const MeshTexture& texture, VertexIndex face) {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (int i = 0; i < 3; ++i) {
    low = std::min(low, Corner(texture, face, i).x());
    high = std::max(high, Corner(texture, face, i).x());
  }
  return high - low;
}

/// Where a point of the unit sphere lies in the half of the picture for its
/// front (x > 0, u < 0.5) or back.
Eigen::RowVector2d SpherePlace(const Eigen::RowVector3d& p, bool is_front) {
  return {(is_front ? 0.22 : 0.78) + 0.2 * p.y(), 0.5 + 0.4 * p.z()};
}

/// Two charts, seen from the front and from the back.
MeshTexture TwoCharts(const TriangleMesh& sphere) {
  const VertexIndex n = sphere.num_vertices();
  MeshTexture texture;
  texture.coordinates.resize(2 * n, 2);
  for (VertexIndex v = 0; v < n; ++v) {
    texture.coordinates.row(v) = SpherePlace(sphere.positions.row(v), true);
    texture.coordinates.row(n + v) =
        SpherePlace(sphere.positions.row(v), false);
  }
  texture.corners = sphere.faces;
  for (VertexIndex f = 0; f < sphere.num_faces(); ++f) {
    double x = 0;
    for (int i = 0; i < 3; ++i) x += sphere.positions(sphere.faces(f, i), 0);
    if (x < 0) texture.corners.row(f).array() += n;
    texture.material_of_face.push_back(-1);
  }
  return texture;
}

CarriedTexture Carry(const TriangleMesh& x, const TriangleMesh& y,
                     const MeshTexture& texture, const Places& places) {
  const absl::StatusOr<CarriedTexture> carried =
      CarryTexture(x, y, texture, places, {});
  EXPECT_THAT(carried, IsOk());
  return *carried;
}

/// Every corner has what the same corner of Y has.
void ExpectSame(const CarriedTexture& carried, const MeshTexture& texture,
                double tolerance = 0) {
  EXPECT_EQ(carried.faces_without, 0);
  EXPECT_EQ(carried.faces_on_seams, 0);
  ASSERT_EQ(carried.texture.corners.rows(), texture.corners.rows());
  for (VertexIndex f = 0; f < texture.corners.rows(); ++f) {
    for (int i = 0; i < 3; ++i) {
      const double error =
          (Corner(carried.texture, f, i) - Corner(texture, f, i)).norm();
      ASSERT_LE(error, tolerance) << "face " << f;
    }
  }
  EXPECT_EQ(carried.texture.material_of_face, texture.material_of_face);
}

TEST(TextureCarrierTest, TheIdentityCarriesEverythingUnchanged) {
  const TriangleMesh sphere = UnitSphere(3);
  const MeshTexture texture = TwoCharts(sphere);
  ExpectSame(Carry(sphere, sphere, texture,
                   AtVertices(IdentityMap(sphere.num_vertices()))),
             texture);
  // Their weights are rounded.
  ExpectSame(Carry(sphere, sphere, texture, NearestPlaces(sphere, sphere)),
             texture, 1e-12);
}

TEST(TextureCarrierTest, ARelabeledMeshGetsTheSame) {
  const TriangleMesh sphere = UnitSphere(3);
  const MeshTexture texture = TwoCharts(sphere);
  const std::vector<VertexIndex> new_from_old =
      RandomPermutation(sphere.num_vertices(), 5);
  VertexMap map(new_from_old.size());
  for (std::size_t old = 0; old < map.size(); ++old) {
    map[static_cast<std::size_t>(new_from_old[old])] =
        static_cast<VertexIndex>(old);
  }
  ExpectSame(
      Carry(Relabeled(sphere, new_from_old), sphere, texture, AtVertices(map)),
      texture);
}

TEST(TextureCarrierTest, NoFaceSpansTwoCharts) {
  const TriangleMesh y = UnitSphere(3);
  const MeshTexture texture = TwoCharts(y);
  for (const int levels : {2, 4}) {
    // Turned, so that nothing coincides.
    TriangleMesh x = Moved(UnitSphere(levels), 1);
    x.positions.rowwise() -= x.positions.colwise().mean();
    x.positions.rowwise().normalize();
    for (const bool is_precise : {false, true}) {
      const CarriedTexture carried = Carry(
          x, y, texture,
          is_precise ? NearestPlaces(x, y) : AtVertices(NearestMap(x, y)));
      EXPECT_EQ(carried.faces_without, 0);
      // Where X is finer, vertices of Y are those of one face of it.
      EXPECT_EQ(carried.faces_on_seams > 0, is_precise || levels == 2);
      EXPECT_LT(carried.faces_on_seams, x.num_faces() / 2);
      for (VertexIndex f = 0; f < x.num_faces(); ++f) {
        const bool is_front = Corner(carried.texture, f, 0).x() < 0.5;
        for (int i = 1; i < 3; ++i) {
          ASSERT_EQ(Corner(carried.texture, f, i).x() < 0.5, is_front);
        }
      }
    }
  }
}

TEST(TextureCarrierTest, PrecisePlacesAreInterpolated) {
  const TriangleMesh y = UnitSphere(3);
  TriangleMesh x = Moved(UnitSphere(2), 1);
  x.positions.rowwise() -= x.positions.colwise().mean();
  x.positions.rowwise().normalize();
  const Places places = NearestPlaces(x, y);
  const CarriedTexture carried = Carry(x, y, TwoCharts(y), places);
  int exact = 0;
  for (VertexIndex f = 0; f < x.num_faces(); ++f) {
    for (int i = 0; i < 3; ++i) {
      Eigen::RowVector3d position = Eigen::RowVector3d::Zero();
      const PrecisePoint& place =
          places[static_cast<std::size_t>(x.faces(f, i))];
      for (std::size_t k = 0; k < 3; ++k) {
        position += place.weights[k] * y.positions.row(place.vertices[k]);
      }
      const Eigen::RowVector2d found = Corner(carried.texture, f, i);
      const double error =
          (found - SpherePlace(position, found.x() < 0.5)).norm();
      // At most as far as a face of Y is long, on the picture's scale.
      ASSERT_LT(error, 0.12);
      exact += error < 1e-5;
    }
  }
  // The charts are linear, so that all corners but those beside seams agree.
  EXPECT_GE(exact, 3 * (x.num_faces() - carried.faces_on_seams));
}

/// A tube around z whose picture is wrapped around it once: one chart, whose
/// seam is where u = 0 meets u = 1. `is_split` doubles the vertices there.
struct Tube {
  TriangleMesh mesh;
  MeshTexture texture;
};

Tube MakeTube(int around, int rows, double turn, bool is_split) {
  Tube tube;
  const int columns = is_split ? around + 1 : around;
  tube.mesh.positions.resize(columns * (rows + 1), 3);
  tube.mesh.faces.resize(2 * around * rows, 3);
  tube.texture.coordinates.resize((around + 1) * (rows + 1), 2);
  tube.texture.corners.resize(2 * around * rows, 3);
  tube.texture.material_of_face.assign(
      static_cast<std::size_t>(2 * around * rows), -1);
  for (int row = 0; row <= rows; ++row) {
    for (int column = 0; column <= around; ++column) {
      const double u = double(column) / around;
      const double angle = 2 * std::numbers::pi * (column % around) / around;
      tube.texture.coordinates.row(row * (around + 1) + column) << u,
          double(row) / rows;
      if (column == columns) continue;
      tube.mesh.positions.row(row * columns + column) << std::cos(angle + turn),
          std::sin(angle + turn), 2.0 * row / rows;
    }
  }
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < around; ++column) {
      const int f = 2 * (row * around + column);
      const auto fill = [&](Faces& faces, int stride, int next) {
        const int a = row * stride + column;
        const int b = row * stride + next;
        faces.row(f) << a, b, b + stride;
        faces.row(f + 1) << a, b + stride, a + stride;
      };
      fill(tube.mesh.faces, columns, (column + 1) % columns);
      fill(tube.texture.corners, around + 1, column + 1);
    }
  }
  return tube;
}

TEST(TextureCarrierTest, NoFaceSpansAPictureThatIsWrappedAround) {
  const Tube y = MakeTube(32, 12, 0, false);
  for (const auto& [around, rows] : {std::pair(20, 8), std::pair(67, 30)}) {
    const Tube x = MakeTube(around, rows, 0.15, false);
    for (const bool is_precise : {false, true}) {
      const CarriedTexture carried =
          Carry(x.mesh, y.mesh, y.texture,
                is_precise ? NearestPlaces(x.mesh, y.mesh)
                           : AtVertices(NearestMap(x.mesh, y.mesh)));
      EXPECT_EQ(carried.faces_without, 0);
      // Where X is finer, vertices of Y are those of one face of it.
      EXPECT_EQ(carried.faces_on_seams > 0, is_precise || around == 20);
      for (VertexIndex f = 0; f < x.mesh.num_faces(); ++f) {
        ASSERT_LT(Width(carried.texture, f), 0.1) << f;
      }
    }
  }
}

TEST(TextureCarrierTest, NoFaceSpansAPictureByTheWayAroundAThinLimb) {
  // Faces of X reach farther than the limb is thick.
  const Tube y = MakeTube(32, 12, 0, false);
  for (const double turn : {0.0, 0.15, 0.4}) {
    const Tube x = MakeTube(6, 1, turn, false);
    const CarriedTexture carried = Carry(
        x.mesh, y.mesh, y.texture, AtVertices(NearestMap(x.mesh, y.mesh)));
    EXPECT_EQ(carried.faces_without, 0);
    for (VertexIndex f = 0; f < x.mesh.num_faces(); ++f) {
      ASSERT_LT(Width(carried.texture, f), 0.3) << turn << " " << f;
    }
  }
}

TEST(TextureCarrierTest, DoubledVerticesAlongASeamAreOne) {
  const Tube closed = MakeTube(12, 4, 0, false);
  const Tube split = MakeTube(12, 4, 0, true);
  // The nearest vertex is the first of two: u = 0 at the seam.
  ExpectSame(Carry(closed.mesh, split.mesh, split.texture,
                   AtVertices(NearestMap(closed.mesh, split.mesh))),
             closed.texture);
}

TEST(TextureCarrierTest, MaterialsAreSeams) {
  const TriangleMesh plane = PlaneGrid(8, 8, 1, 1);
  MeshTexture texture;
  texture.coordinates = plane.positions.leftCols(2);
  texture.corners = plane.faces;
  texture.materials = {"left", "right"};
  texture.libraries = {"a.mtl"};
  for (VertexIndex f = 0; f < plane.num_faces(); ++f) {
    double x = 0;
    for (int i = 0; i < 3; ++i) x += plane.positions(plane.faces(f, i), 0) / 3;
    texture.material_of_face.push_back(x < 0.5 ? 0 : 1);
  }
  ExpectSame(Carry(plane, plane, texture,
                   AtVertices(IdentityMap(plane.num_vertices()))),
             texture);
  // Faces of X across the middle keep to one side of it.
  const TriangleMesh x = PlaneGrid(5, 5, 1, 1);
  const CarriedTexture carried =
      Carry(x, plane, texture, NearestPlaces(x, plane));
  EXPECT_EQ(carried.texture.libraries, texture.libraries);
  EXPECT_EQ(carried.faces_on_seams, 10);
  for (VertexIndex f = 0; f < x.num_faces(); ++f) {
    const bool is_left =
        carried.texture.material_of_face[static_cast<std::size_t>(f)] == 0;
    for (int i = 0; i < 3; ++i) {
      const double u = Corner(carried.texture, f, i).x();
      ASSERT_TRUE(is_left ? u < 0.5 + 1e-6 : u > 0.5 - 1e-6) << f;
    }
  }
}

TEST(TextureCarrierTest, FacesThatLieNowhereAreCounted) {
  const TriangleMesh sphere = UnitSphere(1);
  MeshTexture texture = TwoCharts(sphere);
  VertexMap map = IdentityMap(sphere.num_vertices());
  map[0] = kNoVertex;
  const auto at_vertex = static_cast<int>((sphere.faces.array() == 0).count());
  const CarriedTexture carried =
      Carry(sphere, sphere, texture, AtVertices(map));
  EXPECT_EQ(carried.faces_without, at_vertex);
  EXPECT_EQ((carried.texture.corners.col(0).array() < 0).count(), at_vertex);
  // Nor do faces of Y without a texture give any.
  texture.corners.setConstant(-1);
  EXPECT_EQ(Carry(sphere, sphere, texture,
                  AtVertices(IdentityMap(sphere.num_vertices())))
                .faces_without,
            sphere.num_faces());
}

TEST(TextureCarrierTest, ThePosesOfTheSampleShareTheirPattern) {
  const absl::StatusOr<Sample> x = MakeSample({'A', 2500, 1});
  const absl::StatusOr<Sample> y = MakeSample({'B', 2000, 1});
  ASSERT_TRUE(x.ok() && y.ok());
  const CarriedTexture carried =
      Carry(x->mesh, y->mesh, SampleTexture(*y, "b.mtl"),
            AtVertices(SampleTruth(*x, *y)));
  EXPECT_EQ(carried.faces_without, 0);
  double sum = 0;
  for (VertexIndex f = 0; f < x->mesh.num_faces(); ++f) {
    ASSERT_LT(Width(carried.texture, f), 0.1) << f;
    for (int i = 0; i < 3; ++i) {
      const Eigen::RowVector2d found = Corner(carried.texture, f, i);
      sum += (found - SampleCoordinates(x->rest.row(x->mesh.faces(f, i)),
                                        found.x() < 0.5))
                 .norm();
    }
  }
  // The nearest vertex is half an edge away: a hundredth of the picture.
  EXPECT_LT(sum / (3.0 * x->mesh.num_faces()), 0.015);
}

TEST(TextureCarrierTest, CanBeStopped) {
  const TriangleMesh sphere = UnitSphere(3);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(CarryTexture(sphere, sphere, TwoCharts(sphere),
                         AtVertices(IdentityMap(sphere.num_vertices())),
                         stop.get_token())
                .status()
                .code(),
            absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace isomatch
