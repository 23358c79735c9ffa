#include "client/viewer/picture.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <numbers>

#include <Eigen/Geometry>

#include "core/mesh/mesh_geometry.h"

namespace isomatch {
namespace {

constexpr int kStripes = 10;
constexpr int kSupersampling = 2;
constexpr Rgb kBackground = {255, 255, 255};

/// Where the viewer stands, as in src/stage.js: a little to the side and above.
constexpr double kTurn = 25 * std::numbers::pi / 180;
constexpr double kRaise = 10 * std::numbers::pi / 180;

/// Part of a half that its shape may fill.
constexpr double kFilled = 0.9;

/// The scale, as parts of the picture's height and width.
constexpr double kScaleHeight = 0.022;
constexpr double kScaleWidth = 0.3;

Eigen::Matrix3d CameraRotation(const Eigen::Matrix3d& rotation) {
  return Eigen::AngleAxisd(kRaise, Eigen::Vector3d::UnitX())
             .toRotationMatrix() *
         Eigen::AngleAxisd(-kTurn, Eigen::Vector3d::UnitY())
             .toRotationMatrix() *
         rotation;
}

/// Positions as right, up, to the viewer, around the middle of what is seen.
Positions Seen(const TriangleMesh& mesh, const Eigen::Matrix3d& camera) {
  Positions seen = NormalizedPositions(mesh) * camera.transpose();
  const Eigen::RowVector3d middle =
      (seen.colwise().minCoeff() + seen.colwise().maxCoeff()) / 2;
  seen.rowwise() -= middle;
  return seen;
}

/// Pixels for a unit, so that what is seen fits a half.
double FittingScale(const Positions& seen, int width, int height) {
  const Eigen::RowVector3d reach = seen.cwiseAbs().colwise().maxCoeff();
  return kFilled / 2 * std::min(width / reach[0], height / reach[1]);
}

/// Right, up, near become column, row, near.
Positions OnScreen(const Positions& seen, double scale, int width, int height) {
  Positions points = seen * scale;
  points.col(0).array() += width / 2.0;
  points.col(1) = height / 2.0 - points.col(1).array();
  return points;
}

void Paste(const Image& part, int first_column, Image& image) {
  for (int row = 0; row < part.height; ++row) {
    std::copy_n(&part.At(0, row), part.width, &image.At(first_column, row));
  }
}

void DrawScale(const Palette& palette, Image& image) {
  const int height =
      std::max(2, static_cast<int>(std::lround(kScaleHeight * image.height)));
  const int width = static_cast<int>(std::lround(kScaleWidth * image.width));
  const int left = (image.width - width) / 2;
  const int top = image.height - 2 * height;
  for (int row = top; row < top + height; ++row) {
    for (int column = 0; column < width; ++column) {
      image.At(left + column, row) =
          palette[static_cast<std::size_t>(column) * palette.size() / width];
    }
  }
}

/// X's vertices take the places of their images.
Positions PlacesOfX(const PairView& view, const Positions& places_y) {
  Positions places = Positions::Zero(view.x.mesh.num_vertices(), 3);
  for (Eigen::Index x = 0; x < places.rows(); ++x) {
    const VertexIndex y = view.y_from_x[x];
    if (y == kNoVertex) continue;
    places.row(x) =
        view.precise.empty()
            ? places_y.row(y).eval()
            : Interpolated(places_y, view.y.mesh.faces, view.precise[x]);
  }
  return places;
}

/// Those of Y; without a counterpart it is plain, as X is.
Positions PlacesOfY(const PairView& view, Positions places_y) {
  for (std::size_t y = 0; y < view.matched_y.size(); ++y) {
    if (view.matched_y[y] == 0) {
      places_y.row(static_cast<Eigen::Index>(y)).setZero();
    }
  }
  return places_y;
}

/// One shape, and what its half of the picture shows of it.
struct Half {
  const TriangleMesh& mesh;
  std::vector<Rgb> colors;
  Positions places;
  Positions seen;
};

Image DrawHalf(const Half& half, const Eigen::Matrix3d& camera, double scale,
               Pattern pattern, Image image) {
  const DrawnSurface surface = {
      .points = OnScreen(half.seen, scale, image.width, image.height),
      .faces = half.mesh.faces,
      .normals = VertexNormals(half.mesh) * camera.transpose(),
      .colors = half.colors,
      .places = half.places};
  DrawSurface(surface, pattern, image);
  return HalfSize(image);
}

}  // namespace

Positions PatternPlaces(const TriangleMesh& mesh) {
  const Eigen::RowVector3d low = mesh.positions.colwise().minCoeff();
  const Eigen::RowVector3d extents = mesh.positions.colwise().maxCoeff() - low;
  int longest = 0;
  const double extent = extents.maxCoeff(&longest);
  Positions places(mesh.num_vertices(), 3);
  for (int axis = 0; axis < 3; ++axis) {
    const int from = (longest + axis) % 3;
    places.col(axis) =
        kStripes * (mesh.positions.col(from).array() - low[from]) / extent;
  }
  return places;
}

Image DrawPair(const PairView& view, const PictureOptions& options) {
  const ScalarLayer* layer = FindLayer(view, options.layer);
  assert(layer != nullptr || options.layer == "colors");
  const Eigen::Matrix3d camera = CameraRotation(view.rotation);
  const Positions places_y = PatternPlaces(view.y.mesh);
  const Half halves[] = {
      {view.x.mesh, layer ? LayerColors(*layer, layer->on_x) : ColorsOfX(view),
       PlacesOfX(view, places_y), Seen(view.x.mesh, camera)},
      {view.y.mesh, layer ? LayerColors(*layer, layer->on_y) : ColorsOfY(view),
       PlacesOfY(view, places_y), Seen(view.y.mesh, camera)}};
  const int half_width = options.width / 2;
  const int wide = kSupersampling * half_width;
  const int high = kSupersampling * options.height;
  const double scale = std::min(FittingScale(halves[0].seen, wide, high),
                                FittingScale(halves[1].seen, wide, high));
  Image picture(options.width, options.height, kBackground);
  for (int i = 0; i < 2; ++i) {
    const Image drawn = DrawHalf(halves[i], camera, scale, options.pattern,
                                 Image(wide, high, kBackground));
    Paste(drawn, i * (options.width - half_width), picture);
  }
  if (layer) DrawScale(layer->palette, picture);
  return picture;
}

}  // namespace isomatch
