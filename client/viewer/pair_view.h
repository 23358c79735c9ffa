#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "absl/types/span.h"
#include "client/picture/colors.h"
#include "core/base/vertex_index.h"
#include "core/mesh/surface_point.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// A number at every vertex of both shapes; NaN where there is none.
struct ScalarLayer {
  /// "confidence", "error" or "distortion".
  std::string id = {};
  std::string label = {};
  std::string description = {};
  /// Ends of the scale; numbers beyond have the colors of the ends.
  double low = 0;
  double high = 1;
  Palette palette = {};
  std::vector<float> on_x = {};
  std::vector<float> on_y = {};
};

/// A table of labels and values.
struct FigureTable {
  std::string title;
  std::vector<std::pair<std::string, std::string>> rows;
};

struct NamedMesh {
  /// Shown above the shape: the name of its file.
  std::string name;
  TriangleMesh mesh;
};

/// All that a page or a picture shows of two shapes and a map.
struct PairView {
  std::string title;
  NamedMesh x;
  NamedMesh y;
  VertexMap y_from_x;
  /// Where on the faces of Y the vertices of X go, when that is known: one for
  /// each, whose heaviest vertices are y_from_x. Empty otherwise.
  std::vector<SurfacePoint> precise = {};
  /// For each vertex of Y 1 where it has a counterpart on X, else 0, which is
  /// shown gray. Empty: all have, as far as is known.
  std::vector<std::uint8_t> matched_y = {};
  std::vector<Rgb> colors_y;
  /// X's own, in pictures; not set: each vertex has the color of its image.
  std::optional<std::vector<Rgb>> colors_x;
  std::vector<ScalarLayer> layers;
  /// Rows lead right, up and to the viewer, in the axes of the files.
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  std::vector<FigureTable> figures;
  std::vector<std::string> warnings;
};

/// Where vertices lie in pages and pictures: the middle of the faces' box is
/// the origin, the surface's area 1. Vertices on no face, which nobody sees,
/// are moved into that box, or a far one would leave the shape no room.
Positions NormalizedPositions(const TriangleMesh& mesh);

/// Returns PairView::rotation. Up is axis `up` (0 to 2), else the files' y
/// axis, or z when the shapes are flattest along y. The viewer looks along the
/// flattest of the other two, from the front when that is +z, -y or +x.
Eigen::Matrix3d ViewRotation(const TriangleMesh& mesh_x,
                             const TriangleMesh& mesh_y, std::optional<int> up);

/// Carries a layer from X: a vertex of Y gets the mean over the vertices that
/// go there; where none does, what the nearest reached one, by edges, has. NaN
/// where nothing leads, and where `matched_y` (PairView::matched_y) is 0.
std::vector<float> CarryToY(absl::Span<const float> on_x,
                            absl::Span<const VertexIndex> y_from_x,
                            const TriangleMesh& mesh_y,
                            absl::Span<const std::uint8_t> matched_y = {});

/// colors_x, else those of the images.
std::vector<Rgb> ColorsOfX(const PairView& view);

/// colors_y, kGray where there is no counterpart; the files' own as they are.
std::vector<Rgb> ColorsOfY(const PairView& view);

/// What is gray, in words: "no counterpart: 3 vertices of X, 5 of Y". Empty
/// when all vertices on faces have one.
std::string GrayText(const PairView& view);

/// The colors of a layer; kGray where it has no number.
std::vector<Rgb> LayerColors(const ScalarLayer& layer,
                             absl::Span<const float> values);

/// The layer of that id; nullptr for none.
const ScalarLayer* FindLayer(const PairView& view, const std::string& id);

}  // namespace isomatch
