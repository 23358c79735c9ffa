// What refusing a crafted file costs: time and memory, printed as a table. Only
// that it is refused and the memory are asserted; times depend on the machine.

#include <sys/resource.h>

#include <cstdint>
#include <functional>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "client/files/mesh_file.h"
#include "tests/client/files/gzip.h"
#include "tests/server/test_server.h"
#include "tests/support/hostile_draco.h"
#include "tests/support/matchers.h"
#include "tests/support/memory_growth.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

constexpr std::int64_t kMiB = std::int64_t{1} << 20;

/// Of all threads of this process.
absl::Duration CpuTime() {
  rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  return absl::DurationFromTimeval(usage.ru_utime) +
         absl::DurationFromTimeval(usage.ru_stime);
}

/// Calls `refuse` and prints what that took.
void Measure(const std::string& name, std::size_t bytes,
             const std::function<void()>& refuse) {
  const MemoryGrowth growth;
  const absl::Duration cpu_before = CpuTime();
  const absl::Time begin = absl::Now();
  refuse();
  const absl::Duration took = absl::Now() - begin;
  const absl::Duration cpu = CpuTime() - cpu_before;
  const std::int64_t grown = growth.Bytes();
  absl::PrintF("%-40s %8d B %6.1f ms, CPU %6.1f ms %6.1f MiB\n", name, bytes,
               absl::ToDoubleMilliseconds(took),
               absl::ToDoubleMilliseconds(cpu),
               static_cast<double>(grown) / kMiB);
  EXPECT_LT(grown, 64 * kMiB) << name;
}

class HostileFilesTest : public TestServer {
 protected:
  HostileFilesTest() { Restart(TestConfig(), CoreMatchEngine()); }
};

TEST_F(HostileFilesTest, CreateJobRefusesEach) {
  Watch(CreateJob());  // what is allocated once
  for (const HostileDraco& file : HostileDracoFiles()) {
    v1::CreateJobRequest request = SphereJob();
    request.mutable_mesh_y()->set_draco(file.bytes);
    request.mutable_mesh_y()->clear_vertex_count();
    Measure(file.name, file.bytes.size(), [&] {
      EXPECT_EQ(CreateError(request).reason, "MESH_MALFORMED") << file.name;
    });
  }
  EXPECT_NE(CreateJob(), "");
}

TEST(HostileMeshFilesTest, TheClientRefusesEach) {
  const std::string ply =
      "ply\nformat binary_little_endian 1.0\nelement vertex 2000000000\n"
      "property float x\nproperty float y\nproperty float z\n"
      "element face 2000000000\nproperty list uchar int vertex_indices\n"
      "end_header\n";
  const std::string list =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"
      "property float y\nproperty float z\nelement face 1\n"
      "property list int int vertex_indices\nend_header\n"
      "0 0 0\n1 0 0\n0 1 0\n2000000000 0 1 2\n";
  const std::string stl = std::string(80, ' ') + std::string(4, '\xff');
  const std::string gltf =
      "{\"asset\":{\"version\":\"2.0\"},\"accessors\":[{\"componentType\":5126,"
      "\"count\":2000000000,\"type\":\"VEC3\"}],\"meshes\":[{\"primitives\":[{"
      "\"attributes\":{\"POSITION\":0}}]}]}";
  const std::string deep = std::string(1'000'000, '[');
  std::string objects = "{\"materials\":[{}";
  for (int i = 0; i < 200'000; ++i) objects += ",{}";
  const std::string vtk =
      "# vtk DataFile Version 3.0\n\nBINARY\nDATASET POLYDATA\n"
      "POINTS 2000000000 double\n";
  const std::string vtp =
      "<VTKFile type=\"PolyData\" "
      "compressor=\"vtkZLibDataCompressor\"><PolyData>"
      "<Piece NumberOfPoints=\"2000000000\"><Points><DataArray "
      "type=\"Float32\" "
      "format=\"binary\">AQAAAADYzE0AAAAACAAAAA==eJxjYAAA</DataArray></Points>"
      "</Piece></PolyData></VTKFile>";
  const std::string member = Gzip(std::string(64 * kMiB, '\n'));
  std::string bomb;
  for (int i = 0; i < 40; ++i) bomb += member;
  const TemporaryFolder folder;
  for (const auto& [name, bytes] :
       {std::pair("huge.ply", ply), std::pair("list.ply", list),
        std::pair("huge.off", std::string("OFF\n2000000000 1 0\n0 0 0\n")),
        std::pair("huge.stl", stl), std::pair("huge.gltf", gltf),
        std::pair("deep.gltf", deep), std::pair("objects.gltf", objects + "]}"),
        std::pair("huge.vtk", vtk), std::pair("bomb.vtp", vtp),
        std::pair("bomb.off.gz", bomb),
        std::pair("index.obj", std::string("v 0 0 0\nf 1 2 2000000000\n"))}) {
    const std::string path = folder.Write(name, bytes);
    Measure(name, bytes.size(), [&] {
      EXPECT_THAT(ReadMesh(path, "X"),
                  StatusIs(absl::StatusCode::kInvalidArgument, testing::_));
    });
  }
}

}  // namespace
}  // namespace isomatch
