#pragma once

#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "client/files/map_file.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch::bench {

/// Two meshes of a set and their truth.
struct MeshPair {
  std::string name_x;
  std::string name_y;
  TriangleMesh mesh_x;
  TriangleMesh mesh_y;
  GroundTruth truth;
};

/// The names in DIR/pairs.txt, two a line.
absl::StatusOr<std::vector<std::pair<std::string, std::string>>> ReadPairNames(
    const std::string& dir);

/// Reads DIR/X.off, DIR/Y.off and DIR/gt_X__Y.txt. Where the truth has no
/// mirrored column but DIR holds a template's mirror map (template_mirror.txt,
/// full_m_rest.off and NAME.idx, the template vertex of each vertex), the
/// mirrored truth is taken over the template.
absl::StatusOr<MeshPair> ReadPair(const std::string& dir,
                                  const std::string& name_x,
                                  const std::string& name_y);

}  // namespace isomatch::bench
