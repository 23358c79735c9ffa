#include "client/files/mesh_file.h"

#include <sys/resource.h>

#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/ascii.h"
#include "tests/client/files/mesh_reading.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr char kObj[] =
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 0\nv 9 9 9\nvn 0 0 1\n"
    "f 1/1/1 2/2/1 3/3/1\nf -2 3 4\n";
constexpr char kPly[] =
    "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\n"
    "property float y\nproperty float z\nelement face 2\n"
    "property list uchar int vertex_indices\nend_header\n"
    "0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 0\n9 9 9\n3 0 1 2\n3 4 2 3\n";

std::int64_t PeakResidentBytes() {
  rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  return std::int64_t{usage.ru_maxrss} * 1024;
}

class MeshFileTest : public MeshReadingTest {};

TEST_F(MeshFileTest, EveryFormatKeepsCountAndOrder) {
  for (const auto& [name, bytes] :
       {std::pair("a.off", kPlainOff), std::pair("a.OFF", kPlainOff),
        std::pair("a.obj", kObj), std::pair("a.ply", kPly)}) {
    const absl::StatusOr<LoadedMesh> loaded = Read(name, bytes);
    ASSERT_THAT(loaded, IsOk()) << name;
    ASSERT_EQ(loaded->mesh.num_vertices(), 6) << name;
    EXPECT_EQ(loaded->mesh.positions(5, 2), 9) << name;
    ASSERT_EQ(loaded->mesh.num_faces(), 2) << name;
    EXPECT_EQ(loaded->mesh.faces(1, 0), 4) << name;
    EXPECT_TRUE(loaded->warnings.empty()) << name;
  }
}

TEST_F(MeshFileTest, TheFormatIsToldFromTheFile) {
  EXPECT_EQ(Read("a.OFF", kPlainOff)->format, "OFF");
  EXPECT_EQ(Read("a.obj", kObj)->format, "OBJ");
  EXPECT_EQ(Read("a.ply", kPly)->format, "PLY, ascii");
  ASSERT_THAT(WriteMesh(folder_.Path("b.ply"), UnitSphere(2)), IsOk());
  EXPECT_EQ(ReadMesh(folder_.Path("b.ply"), "X")->format,
            "PLY, binary little endian");
}

TEST_F(MeshFileTest, StlIsWeldedWithAWarning) {
  const std::string facet = "facet normal 0 0 1\nouter loop\n";
  const std::string end = "endloop\nendfacet\n";
  const absl::StatusOr<LoadedMesh> loaded =
      Read("a.stl", "solid s\n" + facet +
                        "vertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\n" + end +
                        facet + "vertex 0 0 0\nvertex 1 1 0\nvertex 0 1 0\n" +
                        end + "endsolid s\n");
  ASSERT_THAT(loaded, IsOk());
  EXPECT_EQ(loaded->mesh.num_vertices(), 4);
  ASSERT_EQ(loaded->warnings.size(), 1u);
  EXPECT_THAT(loaded->warnings[0], HasSubstr("joined to 4 vertices"));
}

// What readers of STL take, writers write.
TEST_F(MeshFileTest, StlMayBeginWithBlanksGoOnAndTrail) {
  const auto facet = [](const std::string& z) {
    return "facet normal 0 0 1 outer loop vertex 0 0 " + z + " vertex 1 0 " +
           z + "\nvertex 1 1 " + z + " endloop endfacet\n";
  };
  const std::string two = "\n  solid one endsolid vertex\n" + facet("0") +
                          "endsolid one\nsolid\n" + facet("1");
  const auto text = Read("a.stl", two + "endsolid\n");
  ASSERT_THAT(text, IsOk());
  EXPECT_EQ(text->mesh.num_faces(), 2);
  EXPECT_EQ(text->format, "STL");
  EXPECT_EQ(*text->colors, std::nullopt);
  EXPECT_THAT(Error("a.stl", two + "endsolid\nvertex 1 2 3\n"),
              Refused("the file ends after 2 triangles without `endsolid`"));
  EXPECT_THAT(Error("a.stl", two),
              Refused("the file ends after 2 triangles without `endsolid`"));
  EXPECT_THAT(
      Error("a.stl", two + facet("nan") + "endsolid\n"),
      Refused("line 9: z of a corner of triangle 2 (0-based) is 'nan'"));

  for (const char* const before : {"", "\xEF\xBB\xBF"}) {
    const auto upper =
        Read("u.stl", before + absl::AsciiStrToUpper(two + "endsolid solid\n"));
    ASSERT_THAT(upper, IsOk());
    EXPECT_EQ(upper->mesh.positions, text->mesh.positions);
  }

  std::string binary(84 + 50, '\0');
  binary.replace(0, 5, "solid");
  binary[80] = 1;
  const float one = 1;
  std::memcpy(&binary[84 + 12], &one, sizeof(one));
  std::memcpy(&binary[84 + 28], &one, sizeof(one));
  const auto trailed = Read("b.stl", binary + "made by hand");
  ASSERT_THAT(trailed, IsOk());
  EXPECT_EQ(trailed->mesh.num_faces(), 1);
}

TEST_F(MeshFileTest, WrittenMeshesComeBack) {
  const TriangleMesh mesh = Moved(BumpySphere(2), 1e-3);
  for (const char* name : {"a.off", "a.ply"}) {
    ASSERT_THAT(WriteMesh(folder_.Path(name), mesh), IsOk());
    const absl::StatusOr<LoadedMesh> loaded = ReadMesh(folder_.Path(name), "X");
    ASSERT_THAT(loaded, IsOk());
    EXPECT_EQ(loaded->mesh.faces, mesh.faces);
    const double error =
        (loaded->mesh.positions - mesh.positions).cwiseAbs().maxCoeff();
    // OFF keeps every digit; PLY holds floats.
    EXPECT_LE(error, std::string(name) == "a.off" ? 0 : 1e-9);
  }
  EXPECT_THAT(WriteMesh(folder_.Path("a.stl"), mesh),
              Refused("expected .off, .ply or .glb"));
}

TEST_F(MeshFileTest, PolygonsAreCutAlongTheShorterDiagonal) {
  const absl::StatusOr<LoadedMesh> loaded =
      Read("a.off", "OFF\n4 1 0\n0 0 0\n2 1 0\n4 0 0\n2 -1 0\n4 0 1 2 3\n");
  ASSERT_THAT(loaded, IsOk());
  ASSERT_EQ(loaded->mesh.num_faces(), 2);
  EXPECT_EQ(loaded->mesh.faces(0, 0), 1);
  EXPECT_EQ(loaded->mesh.faces(0, 2), 3);
  ASSERT_EQ(loaded->warnings.size(), 1u);
}

TEST_F(MeshFileTest, ClaimsBeyondTheFileAreRefused) {
  EXPECT_THAT(Error("a.ply",
                    "ply\nformat binary_little_endian 1.0\n"
                    "element vertex 2000000000\nproperty float x\n"
                    "property float y\nproperty float z\nend_header\n"),
              Refused("claims 2000000000 of element vertex"));
  EXPECT_THAT(Error("a.off", "OFF\n2000000000 1 0\n0 0 0\n"),
              Refused("claims 2000000000 vertices"));
  EXPECT_THAT(Error("a.off", "OFF\n3 2000000000 0\n0 0 0\n"),
              Refused("2000000000 faces"));
  EXPECT_THAT(Error("a.off", "OFF\n-3 1 0\n"), Refused("number of vertices"));
}

TEST_F(MeshFileTest, BrokenFilesSayWhatWasExpected) {
  EXPECT_THAT(ReadMesh(folder_.Path("none.off"), "X"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("X: '")));
  EXPECT_THAT(ReadMesh(folder_.Path(""), "X"), Refused("a directory"));
  EXPECT_THAT(Error("a.off", ""), Refused("the file is empty"));
  EXPECT_THAT(Error("a.txt", "hello"),
              Refused("expected a mesh: .off, .obj, .ply, .stl, .glb"));
  EXPECT_THAT(Error("a.off", "hello"), Refused("the letters OFF"));
  EXPECT_THAT(Error("a.ply", "hello"), Refused("the letters ply"));
  EXPECT_THAT(Error("a.obj", "hello"), Refused("lines `v x y z`"));
  EXPECT_THAT(Error("a.stl", "hello"), Refused("X: '"));
}

TEST_F(MeshFileTest, AFaultOfATextHasItsOwnSentenceAndLine) {
  const std::string off = "OFF\n# shape\n3 1 0\n0 0 0\n1 0 0\n\n0 1 0\n";
  EXPECT_THAT(Error("a.off", off + "3 0 1 3\n"),
              Refused("a.off', line 8: face 0 (0-based) names vertex '3', "
                      "expected 0 to 2"));
  EXPECT_THAT(Error("a.off", off + "3 0 1\n"),
              Refused("the file ends in face 0 (0-based)"));
  EXPECT_THAT(Error("a.off", "OFF\n3 1 0\n0 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n"),
              Refused("line 4: y of vertex 1 (0-based) is 'nan', expected a "
                      "finite number"));
  const std::string obj = "v 0 0 0\nv 1 0 0\n# more\nv 0 1 0\n";
  EXPECT_THAT(
      Error("a.obj", obj + "f 1 2 4\n"),
      Refused("a.obj', line 5: a face names vertex 4, expected 1 to 3"));
  EXPECT_THAT(Error("a.obj", obj + "f 1 2\n"),
              Refused("line 5: a face has 2 corners, expected 3 or more"));
  EXPECT_THAT(Error("a.obj", obj + "f 1 2 0\n"),
              Refused("line 5: a face's corner is '0'"));
  EXPECT_THAT(Error("a.obj", obj + "f -4 1 2\n"),
              Refused("from -3 to -1 to count back"));
  EXPECT_THAT(Error("a.obj", obj + "v 1 inf 0\nf 1 2 3\n"),
              Refused("line 5: a coordinate is 'inf'"));
  EXPECT_THAT(Error("a.obj", obj + "v 1 0\nf 1 2 3\n"),
              Refused("line 5: a vertex has 2 coordinates"));
  const std::string ply(kPly);
  EXPECT_THAT(Error("a.ply", ply.substr(0, ply.size() - 4)),
              Refused("the file ends in item 1 (0-based)"));
  EXPECT_THAT(Error("a.ply", ply.substr(0, ply.size() - 2) + "6\n"),
              Refused("line 17: face 1 (0-based) names vertex 6, expected 0 to "
                      "5"));
  std::string nan = ply;
  nan.replace(nan.find("9 9 9"), 1, "nan");
  EXPECT_THAT(Error("a.ply", nan),
              Refused("line 15: x of vertex 5 (0-based) is nan"));
}

TEST_F(MeshFileTest, WhatFollowsTheLastFaceIsTold) {
  const auto mesh =
      Read("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 2 1 0\n");
  ASSERT_THAT(mesh, IsOk());
  EXPECT_THAT(mesh->warnings,
              ElementsAre(HasSubstr("line 7 and what follows is not read")));
}

// Each a triangle, with what OFF allows beside it.
TEST_F(MeshFileTest, OffFilesOfEveryKindAreRead) {
  const std::string fractions =
      "COFF\n3 1 0\n0 0 0 1 0 0 1\n2 0 0 0 0 0 1\n0 3 0 1 1 1 1\n"
      "3 0 1 2 0.5\n";
  const std::string textured =
      "STCNOFF\n3 1 0\n0 0 0 0 0 1 9 9 9 0 0\n2 0 0 0 0 1 9 9 9 1 0\n"
      "0 3 0 0 0 1 9 9 9 0 1\n3 0 1 2\n";
  for (const std::string& bytes : std::vector<std::string>{
           "OFF 3 1 0\n0 0 0\n2 0 0\n0 3 0\n3 0 1 2\n",
           "OFF\n3 1\n0 0 0\n2 0 0\n0 3 0\n3 0 1 2",
           "OFF\n3\n1\n3\n0 0 0\n2 0 0\n0 3 0\n3 0 1 2\n",
           "\xEF\xBB\xBFOFF\r\n3 1 0\r\n0 0 0\r\n2 0 0\r\n0 3 0\r\n3 0 1 2\r\n",
           "OFF\n3 1 0\n0\n0 0\n2 0\n0\n\n0 3 0 # last\n3 0\n1 2 255 0 0\n",
           "OFF\n3 1 0\n0 0 0\n2e0 0 0\n0 3. 0\n3.0 0.0 1e0 2.0\n", fractions,
           "COFF\n3 1 0\n0 0 0 255\n2 0 0 0 255\n0 3 0\n3 0 1 2 1 1\n",
           textured, "4OFF\n3 1 0\n0 0 0 1\n4 0 0 2\n0 1.5 0 .5\n3 0 1 2\n"}) {
    SCOPED_TRACE(bytes);
    const absl::StatusOr<LoadedMesh> loaded = Read("a.off", bytes);
    ASSERT_THAT(loaded, IsOk());
    Positions positions(3, 3);
    positions << 0, 0, 0, 2, 0, 0, 0, 3, 0;
    EXPECT_EQ(loaded->mesh.positions, positions);
    EXPECT_EQ(loaded->mesh.faces, Faces::NullaryExpr(1, 3, [](auto, auto i) {
                return static_cast<VertexIndex>(i);
              }));
  }
}

TEST_F(MeshFileTest, OffFilesThatAreNoneAreRefused) {
  const std::string points = "0 0 0\n2 0 0\n0 3 0\n";
  const std::string face = "3 0 1 2\n";
  EXPECT_THAT(Error("a.off", "OFF BINARY\n3 1 0\n" + points + face),
              Refused("line 1: the header's number of vertices is 'BINARY'"));
  EXPECT_THAT(Error("a.off", "nOFF\n3 3 1 0\n" + points + face),
              Refused("not nOFF"));
  EXPECT_THAT(Error("a.off", "OFF\n3 1.5 0\n" + points + face),
              Refused("line 2: the header's number of faces is '1.5'"));
  EXPECT_THAT(Error("a.off", "OFF\n"), Refused("number of vertices is ''"));
  EXPECT_THAT(Error("a.off", "OFF\n3 1 0\n0 0\n2 0 0\n0 3 0\n" + face),
              Refused("line 3: vertex 0 (0-based) has less than 3 numbers"));
  EXPECT_THAT(Error("a.off", "OFF\n3 1 0\n\x1b[31m\a 0 0\n" + face),
              Refused("'\\x1b[31m\\x07', expected a finite number"));
  EXPECT_THAT(Error("a.off", "OFF 3 1 0 0 0 0 2 0 0 0 3 0 3 0 1 2"),
              Refused("one a line"));
  EXPECT_THAT(Error("a.off", "OFF\n3 1 0\n" + points + "2 0 1\n"),
              Refused("line 6: face 0 (0-based) has '2' corners"));
  EXPECT_THAT(Error("a.off", "OFF\n3 1 0\n" + points + "3 0 1 1.5\n"),
              Refused("line 6: face 0 (0-based) names vertex '1.5'"));
  EXPECT_THAT(Error("a.off", "OFF\n3 1 0\n" + points + "3 0 1 -1\n"),
              Refused("names vertex '-1', expected 0 to 2"));
  EXPECT_THAT(Error("a.off", "4OFF\n3 1 0\n0 0 0 1\n1 0 0 0\n0 1 0 1\n" + face),
              Refused("line 4: w of vertex 1 (0-based) is 0"));
}

TEST_F(MeshFileTest, PlyFilesWithoutWhatASurfaceHasAreRefused) {
  const auto with = [](const std::string& line, const std::string& instead) {
    std::string ply = kPly;
    return ply.replace(ply.find(line), line.size(), instead);
  };
  const auto refused = Refused("expected one element vertex with x, y, z");
  for (const char* other : {"v", "x", "z"}) {
    EXPECT_THAT(Error("a.ply", with("float y", std::string("float ") + other)),
                refused);
  }
  EXPECT_THAT(Error("a.ply", with("vertex_indices", "corners")), refused);
  EXPECT_THAT(
      Error("a.ply", with("property list uchar int vertex_indices\n", "")),
      Refused("element face has no properties"));
  EXPECT_THAT(Error("a.ply", with("element vertex 6\n", "")), Refused("X: '"));
  EXPECT_THAT(Error("a.ply", with("element vertex 6\n",
                                  "element vertex 0\nelement vertex 6\n")),
              refused);
}

TEST_F(MeshFileTest, CornersOfAnStlFileAtOnePlaceAreOneVertex) {
  const absl::StatusOr<LoadedMesh> loaded = Read(
      "a.stl",
      "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
      "vertex 1 1 0\nendloop\nendfacet\nfacet normal 0 0 1\nouter loop\n"
      "vertex -0 0 0.0\nvertex 1 1 0\nvertex 0 1 0\nendloop\nendfacet\n"
      "endsolid s\n");
  ASSERT_THAT(loaded, IsOk());
  EXPECT_EQ(loaded->mesh.num_vertices(), 4);
  Faces faces(2, 3);
  faces << 0, 1, 2, 0, 2, 3;
  EXPECT_EQ(loaded->mesh.faces, faces);
}

TEST_F(MeshFileTest, AFaultOfAnStlFileIsNamed) {
  const std::string text =
      "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n"
      "vertex 1 nan 0\nvertex 1 1 0\nendloop\nendfacet\nendsolid s\n";
  EXPECT_THAT(
      Error("a.stl", text),
      Refused("line 5: y of a corner of triangle 0 (0-based) is 'nan'"));
  std::string bytes(84 + 2 * 50, '\0');
  bytes[80] = 2;
  const float one = 1;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(&bytes[84 + 12], &one, sizeof(one));
  std::memcpy(&bytes[84 + 28], &one, sizeof(one));
  EXPECT_THAT(Error("a.stl", bytes.substr(0, 150)),
              Refused("claims 2 triangles, but the file has bytes for 1"));
  std::memcpy(&bytes[84 + 50 + 12 + 12 + 8], &nan, sizeof(nan));
  EXPECT_THAT(Error("a.stl", bytes),
              Refused("triangle 1 (0-based): z of corner 1 (0-based) is nan"));
}

TEST_F(MeshFileTest, NonFiniteCoordinatesInBinaryAreRefused) {
  TriangleMesh mesh = UnitSphere(1);
  mesh.positions(7, 1) = std::numeric_limits<double>::quiet_NaN();
  ASSERT_THAT(WriteMesh(folder_.Path("a.ply"), mesh), IsOk());
  EXPECT_THAT(ReadMesh(folder_.Path("a.ply"), "X"), Refused("X: '"));
}

// Each would take gigabytes if it were believed.
TEST_F(MeshFileTest, HostileLengthsOfListsAreRefusedWithLittleMemory) {
  const auto header = [](const std::string& format) {
    return "ply\nformat " + format +
           " 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
           "property float z\nelement face 1\n"
           "property list uint int vertex_indices\nend_header\n";
  };
  const std::string points(36, '\0');
  const std::int64_t peak = PeakResidentBytes();
  for (const char* length : {"4294967295", "400000000", "-1"}) {
    const std::string face = std::string(length) + " 0 1 2\n";
    EXPECT_THAT(
        Error("a.ply", header("ascii") + "0 0 0\n1 0 0\n0 1 0\n" + face),
        Refused("in item 0 (0-based): the length of its list is"));
    EXPECT_THAT(Error("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n" + face),
                Refused("line 6: "));
  }
  for (const char* format : {"binary_little_endian", "binary_big_endian"}) {
    EXPECT_THAT(
        Error("a.ply", header(format) + points + std::string(16, '\x7f')),
        Refused("in item 0 (0-based): the length of its list is"));
  }
  EXPECT_LT(PeakResidentBytes() - peak, 64 << 20);
}

TEST_F(MeshFileTest, CoordinatesBeyondSinglePrecisionAreRefused) {
  EXPECT_THAT(Error("a.off", "OFF\n3 1 0\n0 0 0\n1e39 0 0\n0 1 0\n3 0 1 2\n"),
              Refused("vertex 1 (0-based) has a coordinate of size 1e+39"));
}

/// Of a file whose mesh is good and has three vertices.
class MeshColorsTest : public MeshFileTest {
 protected:
  absl::StatusOr<std::optional<Colors>> ReadColors(const std::string& name,
                                                   const std::string& bytes) {
    const absl::StatusOr<LoadedMesh> loaded = Read(name, bytes);
    EXPECT_THAT(loaded, IsOk());
    EXPECT_EQ(loaded->mesh.num_vertices(), 3);
    return loaded->colors;
  }

  void ExpectRedHalfGreenBlue(const std::string& name,
                              const std::string& bytes) {
    SCOPED_TRACE(bytes);
    const auto found = ReadColors(name, bytes);
    ASSERT_THAT(found, IsOk());
    ASSERT_TRUE(found->has_value());
    Colors expected = Colors::Identity(3, 3);
    expected(1, 1) = 0.5;
    EXPECT_LT((**found - expected).cwiseAbs().maxCoeff(), 0.003);
  }

  void ExpectNone(const std::string& name, const std::string& bytes) {
    EXPECT_EQ(*ReadColors(name, bytes), std::nullopt) << bytes;
  }

  /// Red, half green and blue; `red` is the name of the first channel.
  static std::string Ply(const std::string& type, const std::string& half,
                         const std::string& one, const std::string& red) {
    const std::string property = "property " + type + " ";
    return "ply\nformat ascii 1.0\nelement face 1\n"
           "property list uchar int vertex_indices\nelement vertex 3\n"
           "property float x\nproperty float y\n" +
           property + red + "\n" + property + "green\n" + property +
           "blue\nproperty float z\nend_header\n3 0 1 2\n0 0 " + one +
           " 0 0 0\n1 0 0 " + half + " 0 0\n0 1 0 0 " + one + " 0\n";
  }
};

TEST_F(MeshColorsTest, PlyHasThemAsBytesOrFractions) {
  ExpectRedHalfGreenBlue("a.ply", Ply("uchar", "128", "255", "red"));
  ExpectRedHalfGreenBlue("a.ply", Ply("float", "0.5", "1", "diffuse_red"));
  ExpectRedHalfGreenBlue("a.ply", Ply("ushort", "32768", "65535", "red"));
  ExpectNone("a.ply", Ply("uchar", "128", "255", "alpha"));
  ExpectNone("a.ply", Ply("float", "0.5", "nan", "alpha"));
}

TEST_F(MeshColorsTest, ObjHasThemAsFractionsOrBytes) {
  ExpectRedHalfGreenBlue("a.obj",
                         "v 0 0 0 1 0 0\nv 1 0 0 0 0.5 0\n"
                         "v 0 1 0 0 0 1\nvt 0 0\nvn 0 0 1\nf 1 2 3\n");
  ExpectRedHalfGreenBlue("a.obj",
                         "v 0 0 0 255 0 0\nv 1 0 0 0 128 0\n"
                         "v 0 1 0 0 0 255\nf 1 2 3\n");
  ExpectNone("a.obj", "v 0 0 0 1\nv 1 0 0 1\nv 0 1 0 1\nf 1 2 3\n");
}

TEST_F(MeshColorsTest, OffHasThemAfterTheCoordinates) {
  ExpectRedHalfGreenBlue("a.off",
                         "COFF\n# a comment\n3 1 0\n0 0 0 255 0 0 255\n"
                         "1 0 0 0 128 0 255\n\n0 1 0 0 0 255 255\n3 0 1 2\n");
  ExpectRedHalfGreenBlue("a.off",
                         "OFF 3 1\n0 0 0 1.0 0 0 1\n1 0 0 0 0.5 0 1\n"
                         "0 1 0 0 0 1.0 1\n3 0 1 2 9 9 9\n");
  ExpectRedHalfGreenBlue("a.off",
                         "CNOFF\n3 1 0\n0 0 0 0 0 -1 255 0 0\n"
                         "1 0 0 0 0 -1 0 128 0\n0 1 0 0 0 -1 0 0 255\n"
                         "3 0 1 2\n");
  ExpectRedHalfGreenBlue("a.off",
                         "C4OFF\n3 1 0\n0 0 0 2 255 0 0\n1 0 0 2 0 128 0\n"
                         "0 1 0 2 0 0 255\n3 0 1 2\n");
  ExpectNone("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  ExpectNone("a.off",
             "NOFF\n3 1 0\n0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\n"
             "3 0 1 2\n");
}

TEST_F(MeshColorsTest, WrongOnesAreNoWrongMesh) {
  EXPECT_THAT(
      ReadColors("a.obj", "v 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0 0 0 1\nf 1 2 3\n"),
      Refused("a.obj': 1 of 3 vertices have no color, expected all or "
              "none"));
  EXPECT_THAT(
      ReadColors("a.obj",
                 "v 0 0 0 1 0 0\nv 1 0 0 0 x 0\nv 0 1 0 0 0 1\nf 1 2 3\n"),
      Refused("a.obj', line 2: a vertex's color is 'x', expected a number of "
              "0 or more"));
  EXPECT_THAT(ReadColors("a.off",
                         "COFF\n3 1 0\n0 0 0 1 0 0\n1 0 0 0 -1 0\n"
                         "0 1 0 inf 0 0\n3 0 1 2\n"),
              Refused("a.off', line 4: a vertex's color is '-1'"));
  EXPECT_THAT(ReadColors("a.ply", Ply("float", "nan", "inf", "red")),
              Refused("a.ply', line 14: red of vertex 0 (0-based) is inf, "
                      "expected a finite number"));
}

}  // namespace
}  // namespace isomatch
