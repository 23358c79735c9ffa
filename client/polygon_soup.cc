// The only file that sees CGAL, whose headers take long to compile.

#include "client/polygon_soup.h"

#include <CGAL/Simple_cartesian.h>

#include <CGAL/IO/polygon_soup_io.h>

#include <cstddef>
#include <exception>
#include <stdexcept>
#include <utility>
#include <vector>

namespace isomatch {
namespace {

// A polygon that refuses to grow to what only a hostile file claims: CGAL
// resizes it to the number of corners that a face of an OFF file says it has,
// before it reads them. 8 MiB of indices.
class Polygon : public std::vector<std::size_t> {
 public:
  void resize(std::size_t corners) {
    constexpr std::size_t kMaxCorners = std::size_t{1} << 20;
    // Caught below, with what CGAL itself throws.
    if (corners > kMaxCorners) throw std::length_error("too many corners");
    std::vector<std::size_t>::resize(corners);
  }
};

}  // namespace

bool ReadPolygonSoup(const std::string& path, PolygonSoup* soup) {
  using Point = CGAL::Simple_cartesian<double>::Point_3;
  // CGAL throws on failed preconditions and on counts it cannot allocate.
  try {
    std::vector<Point> points;
    std::vector<Polygon> polygons;
    if (!CGAL::IO::read_polygon_soup(path, points, polygons)) return false;
    soup->polygons.reserve(polygons.size());
    for (Polygon& polygon : polygons) {
      soup->polygons.push_back(std::move(polygon));
    }
    soup->points.reserve(points.size());
    for (const Point& point : points) {
      soup->points.push_back({point.x(), point.y(), point.z()});
    }
    return true;
  } catch (const std::exception&) {
    return false;
  }
}

}  // namespace isomatch
