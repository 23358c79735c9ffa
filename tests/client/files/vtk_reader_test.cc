#include "client/files/vtk_reader.h"

#include <bit>
#include <cstdint>
#include <cstring>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "client/files/mesh_file.h"
#include "tests/client/files/mesh_reading.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::HasSubstr;

constexpr char kVtkHead[] = "# vtk DataFile Version 3.0\na title\n";
constexpr char kVtkPoints[] = "0 0 0  1 0 0  1 1 0  0 1 0";

template <typename T>
std::string BigEndian(std::initializer_list<T> numbers) {
  std::string bytes;
  for (const T number : numbers) {
    std::string one(sizeof(T), '\0');
    std::memcpy(one.data(), &number, sizeof(T));
    bytes.append(one.rbegin(), one.rend());
  }
  return bytes;
}

template <typename T>
std::string LittleEndian(std::initializer_list<T> numbers) {
  std::string bytes(numbers.size() * sizeof(T), '\0');
  std::memcpy(bytes.data(), numbers.begin(), bytes.size());
  return bytes;
}

class VtkReaderTest : public MeshReadingTest {
 protected:
  // A file that must have the two triangles of a square.
  void ExpectSquare(const std::string& name, const std::string& bytes) {
    const auto loaded = Read(name, bytes);
    ASSERT_THAT(loaded, IsOk()) << bytes;
    Positions positions(4, 3);
    positions << 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0;
    Faces faces(2, 3);
    faces << 0, 1, 2, 0, 2, 3;
    EXPECT_EQ(loaded->mesh.positions, positions) << bytes;
    EXPECT_EQ(loaded->mesh.faces, faces) << bytes;
  }
  void ExpectRefused(const std::string& name, const std::string& bytes,
                     const std::string& why) {
    EXPECT_THAT(Read(name, bytes), Refused(why)) << bytes;
  }
};

TEST_F(VtkReaderTest, EveryWayToWriteASquareIsRead) {
  const std::string ascii = absl::StrCat(kVtkHead, "ASCII\nDATASET POLYDATA\n");
  const std::string points =
      absl::StrCat("POINTS 4 double\n", kVtkPoints, "\n");
  ExpectSquare("a.vtk",
               absl::StrCat(ascii, points, "POLYGONS 2 8\n3 0 1 2\n3 0 2 3\n"));
  ExpectSquare("quad.vtk",
               absl::StrCat(ascii, points, "METADATA\nINFORMATION 0\n\n",
                            "VERTICES 1 2\n1 0\nPOLYGONS 1 5\n4 0 1 2 3\n",
                            "POINT_DATA 4\nSCALARS anything\n"));
  ExpectSquare("field.vtk",
               absl::StrCat(ascii, "FIELD FieldData 1\nTime 1 1 float\n0.5\n",
                            points, "POLYGONS 3 6\nOFFSETS vtktypeint64\n",
                            "0 3 6\nCONNECTIVITY vtktypeint64\n0 1 2 0 2 3\n"));
  ExpectSquare("grid.vtk",
               absl::StrCat(kVtkHead, "ASCII\nDATASET UNSTRUCTURED_GRID\n",
                            points, "CELLS 3 11\n2 0 1\n3 0 1 2\n3 0 2 3\n",
                            "CELL_TYPES 3\n3 5 5\n"));
}

TEST_F(VtkReaderTest, BinaryNumbersAreBigEndian) {
  ExpectSquare(
      "b.vtk",
      absl::StrCat(kVtkHead, "BINARY\nDATASET POLYDATA\nPOINTS 4 float\n",
                   BigEndian<float>({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}),
                   "\nPOLYGONS 2 8\n",
                   BigEndian<std::int32_t>({3, 0, 1, 2, 3, 0, 2, 3}), "\n"));
}

// As VTK writes an array of texts, e.g. the coordinate system.
TEST_F(VtkReaderTest, TextsOfFieldsAreSkipped) {
  const std::string field = "DATASET POLYDATA\nFIELD FieldData 2\n";
  const std::string texts = "SPACE 1 3 string\n";
  const std::string time = "Time 1 1 float\n";
  const std::string head = absl::StrCat(kVtkHead, "ASCII\n", field, texts);
  const std::string rest = absl::StrCat(
      time, "0.5\nPOINTS 4 float\n", kVtkPoints, "\nPOLYGONS 1 5\n4 0 1 2 3\n");
  ExpectSquare("t.vtk", absl::StrCat(head, "LPS\n\na%20b c\n", rest));
  ExpectRefused("t.vtk", absl::StrCat(head, "LPS\n"),
                "line 8: the file ends, expected 2 texts more");

  // Lengths of one, two and four bytes.
  const std::string packed = absl::StrCat(
      "\xc3", "LPS", "\x80", BigEndian<std::uint8_t>({70}),
      std::string(70, '\n'), "\x40", BigEndian<std::uint8_t>({0, 0, 2}), "ab");
  const std::string binary = absl::StrCat(
      kVtkHead, "BINARY\n", field, texts, packed, "\n", time,
      BigEndian<float>({0.5}), "\nPOINTS 4 float\n",
      BigEndian<float>({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}),
      "\nPOLYGONS 1 5\n", BigEndian<std::int32_t>({4, 0, 1, 2, 3}), "\n");
  ExpectSquare("t.vtk", binary);
  ExpectRefused("t.vtk",
                absl::StrCat(kVtkHead, "BINARY\n", field, texts, "\xc9", "LPS"),
                "the file ends, expected 3 texts more");
  ExpectRefused("t.vtk",
                absl::StrCat(kVtkHead, "BINARY\n", field, texts, "\x3f", "PS"),
                "the file ends, expected 3 texts more");
}

TEST_F(VtkReaderTest, StripsAlternate) {
  const auto loaded =
      Read("s.vtk",
           absl::StrCat(kVtkHead, "ASCII\nDATASET POLYDATA\nPOINTS 4 float\n",
                        kVtkPoints, "\nTRIANGLE_STRIPS 1 5\n4 0 1 3 2\n"));
  ASSERT_THAT(loaded, IsOk());
  Faces faces(2, 3);
  faces << 0, 1, 3, 1, 2, 3;
  EXPECT_EQ(loaded->mesh.faces, faces);
}

TEST_F(VtkReaderTest, WrongLegacyFilesSayWhere) {
  const std::string ascii = absl::StrCat(kVtkHead, "ASCII\nDATASET POLYDATA\n");
  const std::string points = absl::StrCat("POINTS 4 float\n", kVtkPoints, "\n");
  ExpectRefused("a.vtk", "hello", "line 1: expected `# vtk DataFile");
  ExpectRefused("a.vtk", absl::StrCat(kVtkHead, "TEXT\n"),
                "line 3: found 'TEXT', expected ASCII or BINARY");
  ExpectRefused("a.vtk", absl::StrCat(kVtkHead, "ASCII\nDATASET IMAGE\n"),
                "the dataset is 'IMAGE', expected POLYDATA");
  ExpectRefused("a.vtk", ascii + "POINTS 2000000000 float\n0 0 0\n",
                "claims 6000000000 numbers");
  ExpectRefused("a.vtk", ascii + "POINTS 1 float\n0 0 q\n",
                "line 6: found 'q', expected a finite number");
  ExpectRefused("a.vtk", ascii + points + "POLYGONS 1 4\n3 0 1 4\n",
                "cell 0 (0-based): it names vertex 4, expected 0 to 4 - 1");
  ExpectRefused("a.vtk", ascii + points + "POLYGONS 1 4\n9 0 1 2\n",
                "cell 0 (0-based) has 9 vertices");
  ExpectRefused("a.vtk", ascii + points + "POLYGONS 1 3\n2 0 1\n",
                "it has 2 vertices, expected 3 or more");
  ExpectRefused("a.vtk",
                ascii + points +
                    "POLYGONS 3 3\nOFFSETS vtktypeint64\n0 3 1\n"
                    "CONNECTIVITY vtktypeint64\n0 1 2\n",
                "its vertices are those from 3 to below 1");
  ExpectRefused("a.vtk",
                absl::StrCat(kVtkHead, "BINARY\nDATASET POLYDATA\n",
                             "POINTS 100000 float\n0000"),
                "byte 79: the header claims 300000 numbers");
}

// A .vtp file of the square, whose arrays are what is given.
std::string Vtp(const std::string& attributes, const std::string& points,
                const std::string& connectivity, const std::string& offsets,
                const std::string& end = "</VTKFile>") {
  return absl::StrCat(
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" ", attributes,
      "><PolyData><Piece NumberOfPoints=\"4\" NumberOfPolys=\"2\"><Points>"
      "<DataArray type=\"Float32\" NumberOfComponents=\"3\" ",
      points,
      "</DataArray></Points><Polys>"
      "<DataArray type=\"Int32\" Name=\"connectivity\" ",
      connectivity, "</DataArray><DataArray type=\"UInt8\" Name=\"offsets\" ",
      offsets, "</DataArray></Polys></Piece></PolyData>", end);
}

const std::string& RawPoints() {
  static const auto* const bytes = new std::string(
      LittleEndian<float>({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}));
  return *bytes;
}
const std::string& RawCorners() {
  static const auto* const bytes =
      new std::string(LittleEndian<std::int32_t>({0, 1, 2, 0, 2, 3}));
  return *bytes;
}

// A block with its length before it.
std::string Block(const std::string& bytes) {
  return LittleEndian({static_cast<std::uint32_t>(bytes.size())}) + bytes;
}

TEST_F(VtkReaderTest, XmlArraysAreTextBase64OrAppended) {
  const std::string offsets = "\x03\x06";
  ExpectSquare("t.vtp",
               Vtp("", absl::StrCat("format=\"ascii\">", kVtkPoints),
                   "format=\"ascii\">0 1 2 0 2 3", "format=\"ascii\">3 6"));
  const auto base64 = [](const std::string& bytes) {
    return absl::StrCat("format=\"binary\">\n ",
                        absl::Base64Escape(Block(bytes)));
  };
  ExpectSquare("b.vtp", Vtp("byte_order=\"LittleEndian\"", base64(RawPoints()),
                            base64(RawCorners()), base64(offsets)));
  const auto at = [](std::size_t offset) {
    return absl::StrCat("format=\"appended\" offset=\"", offset, "\">");
  };
  const std::string all =
      Block(RawPoints()) + Block(RawCorners()) + Block(offsets);
  ExpectSquare("r.vtp", Vtp("", at(0), at(52), at(80),
                            absl::StrCat("<AppendedData encoding=\"raw\">\n  _",
                                         all, "\n</AppendedData></VTKFile>")));
}

TEST_F(VtkReaderTest, WrongXmlFilesSayWhere) {
  const std::string points = absl::StrCat("format=\"ascii\">", kVtkPoints);
  const std::string corners = "format=\"ascii\">0 1 2 0 2 3";
  const std::string offsets = "format=\"ascii\">3 6";
  ExpectRefused("a.vtp", "<VTKFile", "byte 7: not XML");
  ExpectRefused("a.vtp", "<VTKFile type=\"UnstructuredGrid\"/>",
                "its type is 'UnstructuredGrid'");
  ExpectRefused(
      "a.vtp",
      Vtp("compressor=\"vtkLZ4DataCompressor\"", points, corners, offsets),
      "expected vtkZLibDataCompressor");
  ExpectRefused("a.vtp", Vtp("", "format=\"ascii\">0 0", corners, offsets),
                "piece 0 (0-based), Points: 12 numbers are claimed");
  ExpectRefused("a.vtp",
                Vtp("", points, "format=\"ascii\">0 1 2 0 2 9", offsets),
                "Polys, cell 1 (0-based): it names vertex 9");
  ExpectRefused("a.vtp", Vtp("", "format=\"binary\">AAAA", corners, offsets),
                "Points: its bytes end early");
  ExpectRefused("a.vtp",
                Vtp("", "format=\"appended\" offset=\"7\">", corners, offsets),
                "a DataArray is appended at '7', expected 0 to below 0");
  ExpectRefused("a.vtp", Vtp("", points, corners, "format=\"ascii\">3 200"),
                "Polys: 200 numbers are claimed");
}

TEST_F(VtkReaderTest, AnyCutFileEndsInAStatus) {
  const std::string offsets = "\x03\x06";
  const auto base64 = [](const std::string& bytes) {
    return absl::StrCat("format=\"binary\">", absl::Base64Escape(Block(bytes)));
  };
  const std::string vtp =
      Vtp("", base64(RawPoints()), base64(RawCorners()), base64(offsets));
  for (std::size_t size = 1; size < vtp.size(); ++size) {
    EXPECT_FALSE(Read("cut.vtp", vtp.substr(0, size)).ok()) << size;
  }
}

}  // namespace
}  // namespace isomatch
