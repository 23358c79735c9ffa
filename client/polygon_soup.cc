// The only file that sees CGAL, whose headers take long to compile.

#include "client/polygon_soup.h"

#include <CGAL/Simple_cartesian.h>

#include <CGAL/IO/polygon_soup_io.h>

#include <exception>
#include <vector>

namespace isomatch {
bool ReadPolygonSoup(const std::string& path, PolygonSoup* soup) {
  using Point = CGAL::Simple_cartesian<double>::Point_3;
  // CGAL throws on failed preconditions and on counts it cannot allocate.
  try {
    std::vector<Point> points;
    if (!CGAL::IO::read_polygon_soup(path, points, soup->polygons)) {
      return false;
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
