#include "client/files/input_file.h"

#include <fcntl.h>
#include <sys/eventfd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/ascii.h"
#include "client/files/map_file.h"
#include "client/files/mesh_file.h"
#include "client/files/named_vertices.h"
#include "client/files/place_file.h"
#include "tests/client/files/gzip.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr std::int64_t kMuch = std::int64_t{1} << 30;

auto RefusedInput(const std::string& why) {
  return StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(why));
}

// A file as standard input, while this lives.
class StandardInput {
 public:
  explicit StandardInput(const std::string& path) : before_(dup(STDIN_FILENO)) {
    const int file = open(path.c_str(), O_RDONLY);
    dup2(file, STDIN_FILENO);
    close(file);
  }
  ~StandardInput() {
    dup2(before_, STDIN_FILENO);
    close(before_);
  }
  StandardInput(const StandardInput&) = delete;
  StandardInput& operator=(const StandardInput&) = delete;

 private:
  const int before_;
};

class InputFileTest : public testing::Test {
 protected:
  TemporaryFolder folder_;
};

TEST_F(InputFileTest, APipeIsSentToStandardInput) {
  const std::string path = folder_.Path("pipe.off");
  ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
  EXPECT_THAT(CheckInput(path, "a mesh"),
              RefusedInput("pipe.off': a pipe, expected a mesh; what another"));
  EXPECT_THAT(ReadMesh(path, "X").status(), RefusedInput("a pipe"));
}

TEST_F(InputFileTest, PackedBytesComeBack) {
  std::string bytes;
  for (int i = 0; i < 100'000; ++i) bytes += std::to_string(i * 7919 % 1000);
  EXPECT_EQ(*Unpack(Gzip(bytes), kMuch), bytes);
  // Joined files are one, as `cat` makes them.
  EXPECT_EQ(*Unpack(Gzip(bytes) + Gzip("end"), kMuch), bytes + "end");
}

TEST_F(InputFileTest, DamagedBytesAreToldByTheirPlace) {
  const std::string packed = Gzip(std::string(100'000, 'a') + "b");
  EXPECT_THAT(Unpack(packed.substr(0, packed.size() / 2), kMuch),
              RefusedInput("of the packed file: it ends there, expected more"));
  std::string damaged = packed;
  damaged[packed.size() - 6] ^= 1;  // of the checksum
  EXPECT_THAT(Unpack(damaged, kMuch), RefusedInput("incorrect data check"));
  EXPECT_THAT(Unpack("\x1f\x8bnot gzip at all", kMuch),
              RefusedInput("expected bytes as gzip writes them"));
}

TEST_F(InputFileTest, ABombIsCountedAndRefused) {
  const std::string bomb = Gzip(std::string(64 << 20, '\0'));
  EXPECT_LT(bomb.size(), 100'000u);
  EXPECT_THAT(
      Unpack(bomb, 1 << 20),
      RefusedInput("unpacked it is larger, expected at most 1048576 bytes"));
  EXPECT_THAT(Unpack(bomb, 64 << 20), IsOk());
  EXPECT_GT(MostUnpackedBytes(), std::int64_t{64} << 20);
}

TEST_F(InputFileTest, EveryTextMayBePacked) {
  const std::string off =
      "OFF 4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
      "3 0 1 2\n3 0 2 3\n";
  const LoadedMesh plain = *ReadMesh(folder_.Write("a.off", off), "X");
  for (const char* const name : {"a.off.gz", "a.OFF.GZ", "packed.off"}) {
    const auto packed = ReadMesh(folder_.Write(name, Gzip(off)), "X");
    ASSERT_THAT(packed, IsOk()) << name;
    EXPECT_EQ(packed->mesh.positions, plain.mesh.positions);
    EXPECT_EQ(packed->mesh.faces, plain.mesh.faces);
  }
  const std::string map = folder_.Write("m.txt.gz", Gzip("1\n0\n-1\n"));
  EXPECT_THAT(*ReadMap(map, 2), ElementsAre(1, 0, -1));
  const std::string json =
      folder_.Write("m.json.gz", Gzip(FormatMap({1, 0}, 2, MapFormat::kJson)));
  EXPECT_THAT(*ReadMap(json, 2), ElementsAre(1, 0));
  EXPECT_EQ(ReadLandmarks(folder_.Write("l.txt.gz", Gzip("# c\n0 1\n")), 2, 2)
                ->size(),
            1u);
  EXPECT_THAT(
      ReadGroundTruth(folder_.Write("t.gz", Gzip("0 1\n")), 2, 2)->direct,
      ElementsAre(1, -1));
  EXPECT_THAT(*ReadLabels(folder_.Write("s.txt.gz", Gzip("7\n8\n")), 2),
              ElementsAre(7, 8));
  const TriangleMesh mesh = Tetrahedron();
  EXPECT_EQ(
      (*ReadNamedVertices(folder_.Write("n.gz", Gzip("2 nose\n")), mesh))[0]
          .name,
      "nose");
  EXPECT_TRUE(ReadPlaces(folder_.Write("p.gz", Gzip("0 1 0 0\n")), 1, mesh)
                  ->is_precise);
}

TEST_F(InputFileTest, FaultsOfPackedFilesNameTheFile) {
  EXPECT_THAT(ReadMesh(folder_.Write("a.off.gz", Gzip("")), "X"),
              RefusedInput("a.off.gz': the file is empty"));
  EXPECT_THAT(
      ReadMesh(folder_.Write("b.off.gz", Gzip("OFF 1").substr(0, 12)), "X"),
      RefusedInput("X: '"));
  EXPECT_THAT(
      ReadMesh(folder_.Write("c.off.gz", Gzip("OFF 1 1\n0 0 q\n")), "X"),
      RefusedInput("c.off.gz', line 2: z of vertex 0"));
  EXPECT_THAT(ReadMesh(folder_.Write("c.txt.gz", Gzip("OFF")), "X"),
              RefusedInput("the extension is '.txt', expected a mesh"));
}

TEST_F(InputFileTest, StandardInputIsToldByItsContent) {
  const TriangleMesh mesh = Tetrahedron();
  for (const char* const name : {"a.off", "a.ply", "a.glb"}) {
    ASSERT_THAT(WriteMesh(folder_.Path(name), mesh), IsOk());
    const StandardInput input(folder_.Path(name));
    const auto loaded = ReadMesh("-", "X");
    ASSERT_THAT(loaded, IsOk()) << name;
    EXPECT_EQ(loaded->mesh.faces, mesh.faces) << name;
  }
  const std::string obj = "# made\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  const std::string stl =
      "solid a\nfacet\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
      "endloop\nendfacet\nendsolid\n";
  const std::string vtk =
      "# vtk DataFile Version 3.0\na\nASCII\nDATASET POLYDATA\n"
      "POINTS 3 float\n0 0 0 1 0 0 0 1 0\nPOLYGONS 1 4\n3 0 1 2\n";
  for (const auto& [bytes, format] :
       {std::pair(obj, "OBJ"), std::pair(stl, "STL"),
        std::pair(absl::AsciiStrToUpper(stl), "STL"),
        std::pair(vtk, "VTK, ascii"), std::pair(Gzip(obj), "OBJ"),
        std::pair("\xEF\xBB\xBF" + obj.substr(obj.find('v')), "OBJ"),
        std::pair(Gzip("\xEF\xBB\xBF" + vtk), "VTK, ascii")}) {
    const StandardInput input(folder_.Write("input", bytes));
    const auto loaded = ReadMesh("-", "X");
    ASSERT_THAT(loaded, IsOk()) << format;
    EXPECT_EQ(loaded->format, format);
  }
}

TEST_F(InputFileTest, AClosedStandardInputIsTold) {
  const StandardInput input(folder_.Write("input", ""));
  close(STDIN_FILENO);
  EXPECT_THAT(ReadInput("-", "a mesh"), RefusedInput("is closed, expected a"));
  // As a library leaves it that opens an event then.
  ASSERT_EQ(eventfd(0, EFD_NONBLOCK), STDIN_FILENO);
  EXPECT_THAT(ReadInput("-", "a mesh"), RefusedInput("is closed, expected a"));
}

TEST_F(InputFileTest, MapsComeFromStandardInputOnce) {
  for (const MapFormat format :
       {MapFormat::kText, MapFormat::kNpy, MapFormat::kJson}) {
    const StandardInput input(
        folder_.Write("map", FormatMap({1, 0}, 2, format)));
    EXPECT_THAT(*ReadMap("-", 2), ElementsAre(1, 0));
    EXPECT_THAT(ReadMap("-", 2), RefusedInput("was read before; expected"));
  }
  const StandardInput places(folder_.Write("p", "0 1 0 0\n"));
  EXPECT_TRUE(ReadPlaces("-", 1, Tetrahedron())->is_precise);
}

}  // namespace
}  // namespace isomatch
