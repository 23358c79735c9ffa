#pragma once

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/status/statusor.h"
#include "client/files/mesh_file.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {

/// A square with a repeated (4) and an isolated (5) vertex.
inline constexpr char kPlainOff[] =
    "OFF\n# a comment\n6 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 0\n9 9 9\n"
    "3 0 1 2\n3 4 2 3\n";

/// What ReadMesh makes of files.
class MeshReadingTest : public testing::Test {
 protected:
  absl::StatusOr<LoadedMesh> Read(const std::string& name,
                                  const std::string& bytes) {
    return ReadMesh(folder_.Write(name, bytes), "X");
  }
  absl::Status Error(const std::string& name, const std::string& bytes) {
    return Read(name, bytes).status();
  }
  static auto Refused(const std::string& why) {
    return StatusIs(absl::StatusCode::kInvalidArgument,
                    testing::HasSubstr(why));
  }
  TemporaryFolder folder_;
};

}  // namespace isomatch
