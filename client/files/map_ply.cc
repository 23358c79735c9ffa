#include "client/files/map_ply.h"

#include <cstddef>
#include <limits>
#include <utility>

#include "client/files/ply_file.h"

namespace isomatch {

std::string FormatMapPly(const MapPicture& picture) {
  using Type = PlyColumn::Type;
  const auto image = [&picture](VertexIndex x) {
    return picture.y_from_x[static_cast<std::size_t>(x)];
  };
  std::vector<PlyColumn> columns = {{"y_index", Type::kInt, [&](VertexIndex x) {
                                       return static_cast<double>(image(x));
                                     }}};
  int axis = 0;
  for (const char* name : {"y_x", "y_y", "y_z"}) {
    columns.push_back(
        {name, Type::kFloat, [&picture, image, axis](VertexIndex x) {
           const VertexIndex y = image(x);
           return y == kNoVertex ? std::numeric_limits<double>::quiet_NaN()
                                 : picture.mesh_y.positions(y, axis);
         }});
    ++axis;
  }
  Colors colors(picture.mesh_x.num_vertices(), 3);
  for (VertexIndex x = 0; x < picture.mesh_x.num_vertices(); ++x) {
    const VertexIndex y = image(x);
    colors.row(x) = y == kNoVertex ? kNoColor : picture.colors_y.row(y).eval();
  }
  for (PlyColumn& column : ColorColumns(colors)) {
    columns.push_back(std::move(column));
  }
  if (!picture.confidence.empty()) {
    columns.push_back({"confidence", Type::kFloat, [&picture](VertexIndex x) {
                         return picture.confidence[static_cast<std::size_t>(x)];
                       }});
  }
  return FormatPly(picture.mesh_x, columns);
}

}  // namespace isomatch
