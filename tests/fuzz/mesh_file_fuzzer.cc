// Whatever bytes a file has, the readers of the command line end in a status or
// in something that fits its mesh, and welding leaves that mesh valid. The
// first byte chooses the kind of file, the rest is its content.

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <unistd.h>

#include "client/files/landmark_points.h"
#include "client/files/map_file.h"
#include "client/files/mesh_file.h"
#include "client/files/mesh_weld.h"
#include "client/files/named_vertices.h"
#include "client/files/place_file.h"
#include "tests/fuzz/check.h"

namespace isomatch {
namespace {

// In an order that files of the corpus count on.
constexpr std::array kNames = {
    "m.off",     "m.obj",    "m.ply",      "m.stl",  "map.txt",
    "map.npy",   "map.json", "places.txt", "lm.txt", "truth.txt",
    "names.txt", "m.glb",    "m.gltf",     "m.vtk",  "m.vtp",
    "m.off.gz",  "p.csv",    "p.mrk.json", "p.fcsv", "m.drc"};

/// A folder in memory where there is one; its files are written again and
/// again.
const std::string& Folder() {
  // Not destroyed: it is removed at the very end.
  static const std::string* const folder = [] {
    const std::filesystem::path root =
        std::filesystem::exists("/dev/shm")
            ? "/dev/shm"
            : std::filesystem::temp_directory_path();
    const auto made = root / ("isomatch_fuzz_" + std::to_string(getpid()));
    std::filesystem::create_directories(made);
    std::atexit([] { std::filesystem::remove_all(Folder()); });
    return new std::string(made.string());
  }();
  return *folder;
}

TriangleMesh Tetrahedron() {
  TriangleMesh mesh = {Positions(4, 3), Faces(4, 3)};
  mesh.positions << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1;
  mesh.faces << 0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2;
  return mesh;
}

void CheckMesh(const TriangleMesh& mesh) {
  ISOMATCH_CHECK(ValidateMesh(mesh, "mesh").ok());
  static_cast<void>(AdviseWeld(mesh));
  TriangleMesh welded = mesh;
  if (WeldVertices({0.001, true}, &welded).ok()) {
    ISOMATCH_CHECK(ValidateMesh(welded, "welded").ok());
    ISOMATCH_CHECK(welded.num_vertices() == mesh.num_vertices());
  }
}

void ReadMeshFile(const std::string& path) {
  const absl::StatusOr<LoadedMesh> loaded = ReadMesh(path, "X");
  ISOMATCH_CHECK(loaded.ok() || !loaded.status().message().empty());
  if (!loaded.ok()) return;
  CheckMesh(loaded->mesh);
  const auto& colors = loaded->colors;
  if (colors.ok() && *colors) {
    ISOMATCH_CHECK((*colors)->rows() == loaded->mesh.num_vertices());
    ISOMATCH_CHECK((*colors)->allFinite());
  }
  const auto& texture = loaded->texture;
  if (!texture.ok() || !*texture) return;
  const MeshTexture& found = **texture;
  ISOMATCH_CHECK(found.corners.rows() == loaded->mesh.num_faces());
  ISOMATCH_CHECK(found.corners.minCoeff() >= -1);
  ISOMATCH_CHECK(found.corners.maxCoeff() < found.coordinates.rows());
  ISOMATCH_CHECK(std::ssize(found.material_of_face) == found.corners.rows());
  for (const int material : found.material_of_face) {
    ISOMATCH_CHECK(-1 <= material && material < std::ssize(found.materials));
  }
}

void CheckMap(const absl::StatusOr<VertexMap>& map) {
  if (!map.ok()) return;
  ISOMATCH_CHECK(map->size() == 4);
  for (const VertexIndex y : *map) ISOMATCH_CHECK(-1 <= y && y < 4);
}

void ReadOther(const std::string& name, const std::string& path) {
  const TriangleMesh y = Tetrahedron();
  if (name.starts_with("map")) {
    CheckMap(ReadMap(path, 4, 4));
    static_cast<void>(ReadLabels(path, 4));
  } else if (name == "places.txt") {
    const absl::StatusOr<PlacesOnY> places = ReadPlaces(path, 4, y);
    ISOMATCH_CHECK(!places.ok() || places->points.size() == 4);
  } else if (name == "lm.txt") {
    const auto landmarks = ReadLandmarks(path, 4, 4);
    ISOMATCH_CHECK(!landmarks.ok() || landmarks->size() <= 4);
  } else if (name.starts_with("p.")) {
    const auto points = ReadSnappedPoints(path, y, "Y");
    ISOMATCH_CHECK(!points.ok() || !points->points.empty());
    if (!points.ok()) return;
    for (const SnappedPoint& point : points->points) {
      ISOMATCH_CHECK(0 <= point.vertex && point.vertex < 4);
    }
  } else if (name == "truth.txt") {
    const auto truth = ReadGroundTruth(path, 4, 4);
    ISOMATCH_CHECK(!truth.ok() || truth->direct.size() == 4);
  } else {
    static_cast<void>(ReadNamedVertices(path, y));
  }
}

}  // namespace
}  // namespace isomatch

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data,
                                      std::size_t size) {
  using namespace isomatch;
  if (size == 0) return 0;
  const std::size_t kind = data[0] % kNames.size();
  const std::string path = Folder() + "/" + kNames[kind];
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(data) + 1,
             static_cast<std::streamsize>(size - 1));
  if (std::string(kNames[kind]).starts_with("m.")) {
    ReadMeshFile(path);
  } else {
    ReadOther(kNames[kind], path);
  }
  return 0;
}
