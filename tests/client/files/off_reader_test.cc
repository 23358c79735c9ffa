#include "client/files/off_reader.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/client/files/mesh_reading.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

class OffReaderTest : public MeshReadingTest {};

TEST_F(OffReaderTest, LinesOfAnOffFileMayHaveAnyForm) {
  const absl::StatusOr<LoadedMesh> plain = Read("a.off", kPlainOff);
  ASSERT_THAT(plain, IsOk());
  for (const char* bytes :
       {"OFF\n6 2 0\n0 0 0 \n1 0 0\r\n1\t1 0\n 0 1 0\n0 0 0 # too\n9 9 9e0\n"
        "3 0 1 2 \n3 4 2 3",
        "OFF\r\n6 2 0\r\n0 0\n0\n+1 0 0\n1. 1 -0\n\n0  1 0\n0 0 0\n9 9 9\n"
        "3  0 1 2\n3.0 4 2 3\n",
        "OFF 6 2\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 0\n9 9 9\n3 0\n1 2\n3 +4 2 "
        "3\n"}) {
    const absl::StatusOr<LoadedMesh> other = Read("a.off", bytes);
    ASSERT_THAT(other, IsOk()) << bytes;
    EXPECT_EQ(other->mesh.positions, plain->mesh.positions) << bytes;
    EXPECT_EQ(other->mesh.faces, plain->mesh.faces) << bytes;
  }
}

// Numbers that are read line by line are told as words are.
TEST_F(OffReaderTest, AWrongNumberOfAnOffFileIsQuoted) {
  EXPECT_THAT(Error("a.off", "OFF\n3 1 0\n0 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n"),
              Refused("line 4: y of vertex 1 (0-based) is 'nan'"));
  EXPECT_THAT(Error("a.off", "OFF\n3 1 0\n0 0 0\n1 1e999 0\n0 1 0\n3 0 1 2\n"),
              Refused("line 4: y of vertex 1 (0-based) is '1e999'"));
  EXPECT_THAT(Error("a.off",
                    "OFF\n5 1 0\n0 0 0\n1 0 0\n0 1 0\n0 1 1\n1 1 1\n"
                    "3 0 1 5\n"),
              Refused("line 8: face 0 (0-based) names vertex '5'"));
}

}  // namespace
}  // namespace isomatch
