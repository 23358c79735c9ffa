// write_draco_pair X.drc Y.drc TRUTH: writes FiveArms(3), the same mesh with
// its vertices renamed, and for each vertex of X its vertex of Y, one a line.

#include <fstream>
#include <iostream>
#include <vector>

#include "tests/support/draco_file.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

int Main(int argc, char** argv) {
  if (argc != 4) return 2;
  const TriangleMesh mesh_x = FiveArms(3);
  const std::vector<VertexIndex> y_from_x =
      RandomPermutation(mesh_x.num_vertices(), /*seed=*/1);
  std::ofstream truth(argv[3]);
  for (const VertexIndex y : y_from_x) truth << y << "\n";
  absl::Status status = WriteDracoFile(argv[1], mesh_x);
  status.Update(WriteDracoFile(argv[2], Relabeled(mesh_x, y_from_x)));
  if (!status.ok()) std::cerr << status << "\n";
  return status.ok() ? 0 : 1;
}

}  // namespace
}  // namespace isomatch

int main(int argc, char** argv) { return isomatch::Main(argc, argv); }
