#pragma once

#include <fstream>
#include <string>

#include "core/evaluation/geodesic_error.h"
#include "core/mesh/triangle_mesh.h"
#include "tests/support/draco_file.h"

namespace isomatch {

/// A body of 1,000 vertices, standing and sitting, with its true map.
struct TwoPoses {
  TriangleMesh x;
  TriangleMesh y;
  VertexMap truth;  ///< empty where the files are not there

  double ErrorOf(const VertexMap& y_from_x) const {
    return GeodesicErrorMeter(y).Measure(y_from_x, truth)->mean_over_diameter;
  }
};

inline TwoPoses ReadTwoPoses(const std::string& dir) {
  TwoPoses poses = {ReadDracoFile(dir + "/r1k_m_rest.drc").value(),
                    ReadDracoFile(dir + "/r1k_m_sit.drc").value(),
                    {}};
  poses.truth.resize(poses.x.num_vertices());
  std::ifstream file(dir + "/gt_r1k_m_rest__r1k_m_sit.txt");
  for (VertexIndex& y : poses.truth) file >> y;
  if (!file) poses.truth.clear();
  return poses;
}

}  // namespace isomatch
