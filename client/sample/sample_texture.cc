#include "client/sample/sample_texture.h"

#include <cmath>
#include <cstddef>

#include "absl/strings/str_cat.h"
#include "client/sample/animal_body.h"

namespace isomatch {
namespace {

constexpr char kMaterial[] = "pattern";
constexpr int kWidth = 1024;
constexpr int kHeight = 512;
constexpr int kSquares = 16;

const Eigen::AlignedBox3d& Box() {
  static const Eigen::AlignedBox3d box = AnimalBody().Bounds();
  return box;
}

// Returns the color of the picture at a place, each coordinate 0 to 1.
Eigen::RowVector3d PatternColor(SamplePattern pattern,
                                const Eigen::RowVector2d& place) {
  const bool is_left = place.x() < 0.5;
  // The picture is twice as wide as high, so these squares are square.
  const int column = static_cast<int>(std::floor(2 * kSquares * place.x()));
  const int row = static_cast<int>(std::floor(kSquares * place.y()));
  const int field = pattern == SamplePattern::kChecker ? column + row : column;
  const bool is_dark = field % 2 == 0;
  if (is_left) {
    return is_dark ? Eigen::RowVector3d(0.85, 0.35, 0.1)
                   : Eigen::RowVector3d(1, 0.9, 0.65);
  }
  return is_dark ? Eigen::RowVector3d(0.1, 0.35, 0.6)
                 : Eigen::RowVector3d(0.75, 0.95, 0.95);
}

}  // namespace

Eigen::RowVector2d SampleCoordinates(const Eigen::RowVector3d& rest,
                                     bool is_left) {
  const Eigen::AlignedBox3d& box = Box();
  const double length = box.sizes().maxCoeff();
  const double along = (rest.x() - box.min().x()) / length;
  const double up = (rest.z() - box.min().z()) / length;
  return {along / 2 + (is_left ? 0 : 0.5), up};
}

MeshTexture SampleTexture(const Sample& sample, const std::string& library) {
  // Vertex v has row v on the left and row n + v on the right.
  const VertexIndex n = sample.mesh.num_vertices();
  MeshTexture texture;
  texture.libraries = {library};
  texture.materials = {kMaterial};
  texture.material_of_face.assign(
      static_cast<std::size_t>(sample.mesh.num_faces()), 0);
  texture.coordinates.resize(2 * Eigen::Index{n}, 2);
  for (VertexIndex v = 0; v < n; ++v) {
    texture.coordinates.row(v) = SampleCoordinates(sample.rest.row(v), true);
    texture.coordinates.row(Eigen::Index{n} + v) =
        SampleCoordinates(sample.rest.row(v), false);
  }
  texture.corners = sample.mesh.faces;
  for (VertexIndex f = 0; f < sample.mesh.num_faces(); ++f) {
    double side = 0;
    for (int i = 0; i < 3; ++i) side += sample.rest(sample.mesh.faces(f, i), 1);
    if (side < 0) texture.corners.row(f).array() += n;
  }
  return texture;
}

Image SamplePicture(SamplePattern pattern) {
  Image picture(kWidth, kHeight, kGray);
  for (int row = 0; row < kHeight; ++row) {
    for (int column = 0; column < kWidth; ++column) {
      const Eigen::RowVector2d place((column + 0.5) / kWidth,
                                     1 - (row + 0.5) / kHeight);
      picture.At(column, row) = ColorBytes(PatternColor(pattern, place));
    }
  }
  return picture;
}

Colors SampleColors(const Sample& sample, SamplePattern pattern) {
  Colors colors(sample.rest.rows(), 3);
  for (Eigen::Index v = 0; v < sample.rest.rows(); ++v) {
    const Eigen::RowVector3d rest = sample.rest.row(v);
    colors.row(v) =
        PatternColor(pattern, SampleCoordinates(rest, rest.y() >= 0));
  }
  return colors;
}

std::string SampleMaterial(const std::string& png) {
  return absl::StrCat("newmtl ", kMaterial, "\nKa 1 1 1\nKd 1 1 1\nmap_Kd ",
                      png, "\n");
}

}  // namespace isomatch
