// Streams made to harm: each must end in INVALID_ARGUMENT, quickly and without
// memory. Headers are written byte by byte as the Draco 2.2 bitstream has them.

#include <sys/resource.h>

#include <cstdint>
#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/io/draco_mesh.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::HasSubstr;

constexpr char kSequential = 0;
constexpr char kEdgebreaker = 1;
constexpr char kMesh = 1;

std::string Header(char method, char geometry = kMesh, char major = 2,
                   char minor = 2) {
  return std::string("DRACO") + major + minor + geometry + method +
         std::string(2, '\0');
}

std::string Varint(std::uint32_t value) {
  std::string bytes;
  for (; value >= 128; value >>= 7) {
    bytes += static_cast<char>((value & 127) | 128);
  }
  return bytes + static_cast<char>(value);
}

std::string Padded(std::string bytes, std::size_t size) {
  bytes.resize(size, '\x55');
  return bytes;
}

// Traversal 0, then the counts.
std::string EdgebreakerStream(std::uint32_t vertices, std::uint32_t faces,
                              char connectivities, std::size_t size) {
  return Padded(Header(kEdgebreaker) + '\0' + Varint(vertices) + Varint(faces) +
                    connectivities + Varint(faces) + Varint(0),
                size);
}

// One triangle of three points with 8-bit indices, then `rest`.
std::string SequentialTriangle(const std::string& indices,
                               const std::string& rest) {
  return Header(kSequential) + Varint(1) + Varint(3) + '\1' + indices + rest;
}

// One attributes decoder with one attribute, stored raw.
std::string Attribute(char type, char data_type, char components) {
  return std::string("\1\1") + type + data_type + components +
         std::string("\0\0", 2) + '\0';
}

std::int64_t PeakResidentBytes() {
  rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  return std::int64_t{usage.ru_maxrss} * 1024;
}

// Growth allowed to each stream below.
constexpr std::int64_t kFewBytes = 32 << 20;

absl::Status Decode(const std::string& bytes,
                    VertexOrder order = VertexOrder::kDecoded) {
  const std::int64_t before = PeakResidentBytes();
  const absl::Status status = DecodeDraco(bytes, order, 0).status();
  EXPECT_LT(PeakResidentBytes() - before, kFewBytes);
  return status;
}

auto Refused(const std::string& why) {
  return StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(why));
}

TEST(HostileDracoTest, NotDracoAtAll) {
  EXPECT_THAT(Decode(""), Refused("expected the letters DRACO"));
  EXPECT_THAT(Decode("OFF\n3 1 0\n"), Refused("expected the letters DRACO"));
}

TEST(HostileDracoTest, OtherKindsOfStream) {
  EXPECT_THAT(Decode(Padded(Header(kSequential, /*geometry=*/0), 50)),
              Refused("point cloud"));
  EXPECT_THAT(Decode(Padded(Header(7), 50)), Refused("encoding method 7"));
  EXPECT_THAT(Decode(Padded(Header(kSequential, kMesh, 1, 1), 50)),
              Refused("bitstream 1.1, expected 2.2"));
}

TEST(HostileDracoTest, EdgebreakerOf150BytesClaimingManyFaces) {
  EXPECT_THAT(Decode(EdgebreakerStream(50'000'000, 100'000'000, 0, 150)),
              Refused("100000000 faces, expected at most"));
  EXPECT_THAT(Decode(EdgebreakerStream(3, 700'000'000, 0, 153)),
              Refused("700000000 faces"));
  EXPECT_THAT(Decode(EdgebreakerStream(5'000'000, 9'000'000, 0, 150)),
              Refused("9000000 faces"));
}

TEST(HostileDracoTest, EdgebreakerClaimingManyVertices) {
  EXPECT_THAT(Decode(EdgebreakerStream(4'000'000'000, 100, 0, 150)),
              Refused("4000000000 vertices"));
}

TEST(HostileDracoTest, EdgebreakerClaimingManyAttributeConnectivities) {
  EXPECT_THAT(Decode(EdgebreakerStream(50, 100, '\xff', 150)),
              Refused("255 attribute connectivities"));
}

TEST(HostileDracoTest, SequentialClaimingManyFacesOrPoints) {
  for (const char method : {'\0', '\1'}) {
    const std::string faces =
        Header(kSequential) + Varint(700'000'000) + Varint(3) + method;
    EXPECT_THAT(Decode(Padded(faces, 150)), Refused("700000000 faces"));
    const std::string points =
        Header(kSequential) + Varint(1) + Varint(2'000'000'000) + method;
    EXPECT_THAT(Decode(Padded(points, 150)), Refused("2000000000 vertices"));
  }
}

TEST(HostileDracoTest, WideAttribute) {
  // A megabyte of faces, each point with 255 float64: 2 GB.
  constexpr int kFaces = 340'000;
  std::string stream =
      Header(kSequential) + Varint(kFaces) + Varint(3 * kFaces) + '\1';
  stream += std::string(kFaces * 3, '\0');  // varints
  stream += Attribute(0, /*DT_FLOAT64*/ 10, '\xff');
  EXPECT_THAT(Decode(stream), Refused("bytes of attributes, expected"));
}

TEST(HostileDracoTest, FaceIndexOutOfRange) {
  const std::string values(3 * 12, '\0');
  const std::string positions = Attribute(0, /*DT_FLOAT32*/ 9, 3);
  EXPECT_THAT(
      Decode(SequentialTriangle(std::string("\0\1\2", 3), positions + values)),
      IsOk());
  EXPECT_THAT(
      Decode(SequentialTriangle(std::string("\0\1\3", 3), positions + values)),
      Refused("names vertex 3, expected less than 3"));
}

TEST(HostileDracoTest, NoAttributesOrNoPositions) {
  const std::string indices("\0\1\2", 3);
  EXPECT_THAT(Decode(SequentialTriangle(indices, std::string(1, '\0'))),
              Refused("no POSITION attribute"));
  const std::string normals = Attribute(1, 9, 3) + std::string(3 * 12, '\0');
  EXPECT_THAT(Decode(SequentialTriangle(indices, normals)),
              Refused("no POSITION attribute"));
  const std::string flat = Attribute(0, 9, 2) + std::string(3 * 8, '\0');
  const std::string bools =
      Attribute(0, /*DT_BOOL*/ 11, 3) + std::string(3 * 3, '\7');
  EXPECT_THAT(Decode(SequentialTriangle(indices, bools)),
              Refused("POSITION attribute of 3 numbers"));
  EXPECT_THAT(Decode(SequentialTriangle(indices, flat)),
              Refused("POSITION attribute of 3 numbers"));
}

std::string SmallStream(int isolated) {
  TriangleMesh mesh = UnitSphere(1);
  mesh.positions.conservativeResize(42 + isolated, Eigen::NoChange);
  mesh.positions.bottomRows(isolated).setZero();
  return EncodeDraco(mesh)->bytes;
}

class DamagedStreamTest : public testing::TestWithParam<int> {
 protected:
  const std::string stream_ = SmallStream(/*isolated=*/GetParam());
  const VertexOrder order_ =
      GetParam() > 0 ? VertexOrder::kDecoded : VertexOrder::kIdAttribute;
};

TEST_P(DamagedStreamTest, TruncatedAnywhere) {
  ASSERT_THAT(Decode(stream_, order_), IsOk());
  for (std::size_t size = 0; size < stream_.size(); ++size) {
    EXPECT_THAT(Decode(stream_.substr(0, size), order_), Refused("")) << size;
  }
}

TEST_P(DamagedStreamTest, FlippedBytesGiveAnErrorOrASoundMesh) {
  std::mt19937 random(/*seed=*/5);
  for (int round = 0; round < 20'000; ++round) {
    std::string damaged = stream_;
    for (std::uint32_t flips = 1 + random() % 3; flips > 0; --flips) {
      damaged[random() % damaged.size()] = static_cast<char>(random());
    }
    const absl::StatusOr<TriangleMesh> mesh = DecodeDraco(damaged, order_, 0);
    if (!mesh.ok() || mesh->num_faces() == 0) continue;
    EXPECT_GE(mesh->faces.minCoeff(), 0) << round;
    EXPECT_LT(mesh->faces.maxCoeff(), mesh->num_vertices()) << round;
  }
}

INSTANTIATE_TEST_SUITE_P(EdgebreakerAndSequential, DamagedStreamTest,
                         testing::Values(0, 1));

}  // namespace
}  // namespace isomatch
