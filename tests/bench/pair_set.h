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

/// The names in a file such as DIR/pairs.txt, two a line.
absl::StatusOr<std::vector<std::pair<std::string, std::string>>> ReadPairNames(
    const std::string& path);

/// Reads a pair of DIR: each mesh from NAME.off, or NAME.drc where there is no
/// such file, and the truth from gt_X__Y.txt (as ReadGroundTruth has it).
///
/// DIR may hold shapes of one template, as tests/data does: template_mirror.txt
/// is the mirror map of full_m_rest, NAME.idx the template vertex of each
/// vertex of a shape, and a shape without it is numbered as the template. Then
/// a pair without gt_X__Y.txt may have such a Y, of which X.idx is the truth,
/// and where the truth has no mirrored column it is taken over the template.
absl::StatusOr<MeshPair> ReadPair(const std::string& dir,
                                  const std::string& name_x,
                                  const std::string& name_y);

/// Writes every shape that DIR/pairs.txt names to OUT/NAME.drc.
absl::Status PackShapes(const std::string& dir, const std::string& out);

}  // namespace isomatch::bench
