#include "client/files/draco_reader.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_replace.h"
#include "core/io/draco_mesh.h"
#include "core/io/face_order.h"
#include "tests/client/files/mesh_reading.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

class DracoReaderTest : public MeshReadingTest {};

TEST_F(DracoReaderTest, VerticesOfADracoFileAreNumberedByItsIds) {
  const TriangleMesh sphere = UnitSphere(2);
  const absl::StatusOr<EncodedMesh> compressed = EncodeDraco(sphere);
  const absl::StatusOr<EncodedMesh> plain =
      EncodeDraco(sphere, {.is_local = true});
  ASSERT_THAT(compressed, IsOk());
  ASSERT_THAT(plain, IsOk());
  ASSERT_TRUE(RenumbersVertices(compressed->bytes));
  ASSERT_FALSE(HasVertexIds(plain->bytes));
  Faces faces = sphere.faces;
  SortFaces(sphere.num_vertices(), faces);
  for (const std::string& bytes : {compressed->bytes, plain->bytes}) {
    const absl::StatusOr<LoadedMesh> loaded = Read("a.drc", bytes);
    ASSERT_THAT(loaded, IsOk());
    EXPECT_EQ(loaded->format, "Draco");
    EXPECT_EQ(loaded->mesh.positions,
              sphere.positions.cast<float>().cast<double>());
    EXPECT_EQ(loaded->mesh.faces, faces);
    EXPECT_THAT(loaded->warnings, testing::IsEmpty());
  }
  const std::string without_ids =
      absl::StrReplaceAll(compressed->bytes, {{"vertex_id", "vertex_no"}});
  const absl::StatusOr<LoadedMesh> loaded = Read("a.drc", without_ids);
  ASSERT_THAT(loaded, IsOk());
  EXPECT_EQ(loaded->mesh.num_vertices(), sphere.num_vertices());
  EXPECT_THAT(loaded->warnings,
              testing::ElementsAre(testing::HasSubstr("edgebreaker")));
}

TEST_F(DracoReaderTest, ADracoFileThatIsNoneIsRefused) {
  const std::string bytes = EncodeDraco(UnitSphere(2))->bytes;
  EXPECT_THAT(Error("a.drc", bytes.substr(0, bytes.size() / 2)),
              Refused("damaged or truncated Draco stream"));
  EXPECT_THAT(Error("a.drc", "OFF\n3 1 0\n"), Refused("not a Draco stream"));
  const std::size_t name_end = bytes.find("vertex_id") + 9;
  EXPECT_TRUE(HasVertexIds(bytes));
  for (std::size_t size = 1; size < name_end; ++size) {
    EXPECT_FALSE(HasVertexIds(bytes.substr(0, size))) << size;
    EXPECT_FALSE(Read("a.drc", bytes.substr(0, size)).ok()) << size;
  }
}

}  // namespace
}  // namespace isomatch
