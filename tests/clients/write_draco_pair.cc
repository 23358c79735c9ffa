// write_draco_pair X.drc Y.drc TRUTH: writes FiveArms(3), the same mesh with
// its vertices renamed, and for each vertex of X its vertex of Y, one a line.

#include <fstream>
#include <iostream>
#include <string>
#include <vector>

#include "core/io/draco_mesh.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

bool WriteDraco(const TriangleMesh& mesh, const char* path) {
  const auto encoded = EncodeDraco(mesh);
  if (!encoded.ok()) {
    std::cerr << encoded.status() << "\n";
    return false;
  }
  return static_cast<bool>(std::ofstream(path, std::ios::binary)
                           << encoded->bytes);
}

int Main(int argc, char** argv) {
  if (argc != 4) return 2;
  const TriangleMesh mesh_x = FiveArms(3);
  const std::vector<VertexIndex> y_from_x =
      RandomPermutation(mesh_x.num_vertices(), /*seed=*/1);
  std::ofstream truth(argv[3]);
  for (const VertexIndex y : y_from_x) truth << y << "\n";
  const bool written = WriteDraco(mesh_x, argv[1]) &&
                       WriteDraco(Relabeled(mesh_x, y_from_x), argv[2]);
  return written ? 0 : 1;
}

}  // namespace
}  // namespace isomatch

int main(int argc, char** argv) { return isomatch::Main(argc, argv); }
