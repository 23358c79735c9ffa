// Streams made to harm: each must end in INVALID_ARGUMENT, quickly and without
// memory. Headers are written byte by byte as the Draco 2.2 bitstream has them.

#include <sys/resource.h>

#include <algorithm>
#include <cstdint>
#include <random>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/io/draco_mesh.h"
#include "tests/support/draco_stream.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::HasSubstr;

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

// A sequential stream of faces whose corners are all `corner`, up to where
// attributes are declared.
std::string Uncompressed(std::uint32_t faces, std::uint32_t points,
                         const std::string& corner) {
  std::string bytes = DracoHeader(kDracoSequential) + DracoVarint(faces) +
                      DracoVarint(points) + '\1';
  for (std::uint32_t i = 0; i < 3 * faces; ++i) bytes += corner;
  return bytes;
}

std::string WideAttribute() {
  return DracoAttribute(0, /*DT_FLOAT64*/ 10, '\xff');
}

TEST(HostileDracoTest, NotDracoAtAll) {
  EXPECT_THAT(Decode(""), Refused("expected the letters DRACO"));
  EXPECT_THAT(Decode("OFF\n3 1 0\n"), Refused("expected the letters DRACO"));
}

TEST(HostileDracoTest, OtherKindsOfStream) {
  EXPECT_THAT(Decode(Padded(DracoHeader(kDracoSequential, /*geometry=*/0), 50)),
              Refused("point cloud"));
  EXPECT_THAT(Decode(Padded(DracoHeader(7), 50)), Refused("encoding method 7"));
  EXPECT_THAT(
      Decode(Padded(DracoHeader(kDracoSequential, kDracoMesh, 1, 1), 50)),
      Refused("bitstream 1.1, expected 2.2"));
}

TEST(HostileDracoTest, EdgebreakerOf150BytesClaimingManyFaces) {
  EXPECT_THAT(Decode(EdgebreakerClaim(50'000'000, 100'000'000, 0, 150)),
              Refused("100000000 faces, expected at most"));
  EXPECT_THAT(Decode(EdgebreakerClaim(3, 700'000'000, 0, 153)),
              Refused("700000000 faces"));
  EXPECT_THAT(Decode(EdgebreakerClaim(5'000'000, 9'000'000, 0, 150)),
              Refused("9000000 faces"));
}

TEST(HostileDracoTest, EdgebreakerClaimingManyVertices) {
  EXPECT_THAT(Decode(EdgebreakerClaim(4'000'000'000, 100, 0, 150)),
              Refused("4000000000 vertices"));
}

TEST(HostileDracoTest, EdgebreakerClaimingManyAttributeConnectivities) {
  EXPECT_THAT(Decode(EdgebreakerClaim(50, 100, '\xff', 150)),
              Refused("255 attribute connectivities"));
}

TEST(HostileDracoTest, SequentialClaimingManyFacesOrPoints) {
  for (const char method : {'\0', '\1'}) {
    const std::string faces = DracoHeader(kDracoSequential) +
                              DracoVarint(700'000'000) + DracoVarint(3) +
                              method;
    EXPECT_THAT(Decode(Padded(faces, 150)), Refused("700000000 faces"));
    const std::string points = DracoHeader(kDracoSequential) + DracoVarint(1) +
                               DracoVarint(2'000'000'000) + method;
    EXPECT_THAT(Decode(Padded(points, 150)), Refused("2000000000 vertices"));
  }
}

TEST(HostileDracoTest, WideAttribute) {
  // A megabyte of faces, each point with 255 float64: 2 GB.
  EXPECT_THAT(Decode(Uncompressed(340'000, 1'020'000, std::string(1, '\0')) +
                     WideAttribute()),
              Refused("bytes of attributes, expected"));
}

// Points, and the bytes of a corner for a mesh of so many.
class CornerWidthTest
    : public testing::TestWithParam<std::pair<std::uint32_t, std::string>> {
 protected:
  const std::uint32_t points_ = GetParam().first;
  // As few faces as Draco allows for so many points.
  const std::string stream_ =
      Uncompressed(points_ / 3 + 1, points_, GetParam().second);
};

TEST_P(CornerWidthTest, WideAttributesAreRefusedBeforeFacesAreRead) {
  DracoLimits limits;
  limits.reserve = [](std::int64_t) -> absl::Status {
    return absl::InternalError("no longer ahead of the faces");
  };
  // Two that are too wide only together.
  const std::int64_t most = std::min<std::int64_t>(
      limits.max_attribute_bytes,
      1024 * static_cast<std::int64_t>(stream_.size() + 200));
  const std::int64_t components = most / points_ / 16 + 1;
  ASSERT_LE(components, 255);
  const std::string half =
      DracoAttribute(4, /*DT_FLOAT64*/ 10, static_cast<char>(components))
          .substr(1);
  EXPECT_THAT(DecodeDraco(stream_ + '\2' + half + half, VertexOrder::kDecoded,
                          0, limits),
              Refused("bytes of attributes, expected"));
}

TEST_P(CornerWidthTest, SoundAttributesAreNot) {
  const std::string positions = DracoAttribute(0, /*DT_FLOAT32*/ 9, 3) +
                                std::string(std::size_t{12} * points_, '\0');
  const auto mesh =
      DecodeDraco(stream_ + positions, VertexOrder::kDecoded, points_);
  EXPECT_THAT(mesh, IsOk());
}

INSTANTIATE_TEST_SUITE_P(
    All, CornerWidthTest,
    testing::Values(std::pair(200, std::string(1, '\0')),
                    std::pair(60'000, std::string(2, '\0')),
                    std::pair(70'000, std::string(1, '\0')),
                    // 0 as a varint of more bytes than it needs.
                    std::pair(2'000'000, std::string("\x80\x80\0", 3)),
                    std::pair(2'100'000, std::string(4, '\0'))),
    [](const auto& param) {
      return testing::PrintToString(param.param.first) + "Points";
    });

TEST(HostileDracoTest, FaceIndexOutOfRange) {
  const std::string values(3 * 12, '\0');
  const std::string positions = DracoAttribute(0, /*DT_FLOAT32*/ 9, 3);
  EXPECT_THAT(
      Decode(DracoTriangle(std::string("\0\1\2", 3), positions + values)),
      IsOk());
  EXPECT_THAT(
      Decode(DracoTriangle(std::string("\0\1\3", 3), positions + values)),
      Refused("names vertex 3, expected less than 3"));
}

TEST(HostileDracoTest, NoAttributesOrNoPositions) {
  const std::string indices("\0\1\2", 3);
  EXPECT_THAT(Decode(DracoTriangle(indices, std::string(1, '\0'))),
              Refused("no POSITION attribute"));
  const std::string normals =
      DracoAttribute(1, 9, 3) + std::string(3 * 12, '\0');
  EXPECT_THAT(Decode(DracoTriangle(indices, normals)),
              Refused("no POSITION attribute"));
  const std::string flat = DracoAttribute(0, 9, 2) + std::string(3 * 8, '\0');
  const std::string bools =
      DracoAttribute(0, /*DT_BOOL*/ 11, 3) + std::string(3 * 3, '\7');
  EXPECT_THAT(Decode(DracoTriangle(indices, bools)),
              Refused("POSITION attribute of 3 numbers"));
  EXPECT_THAT(Decode(DracoTriangle(indices, flat)),
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
