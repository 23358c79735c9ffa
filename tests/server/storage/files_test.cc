#include "server/storage/files.h"

#include <sys/resource.h>

#include <csignal>
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/matchers.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::_;
using testing::IsEmpty;
using testing::SizeIs;

std::vector<std::string> NamesIn(const std::string& folder) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    names.push_back(entry.path().filename().string());
  }
  return names;
}

TEST(FilesTest, ABadSectorIsALossAndNoMoreTrying) {
  EXPECT_THAT(ReadInPieces("/proc/self/mem", [](auto&&) { return true; }),
              StatusIs(absl::StatusCode::kDataLoss, _));
}

TEST(FilesTest, ANewFileTakesThePlaceOfTheOldOneWhole) {
  const TemporaryFolder folder;
  const std::string path = folder.Path("file");
  ASSERT_THAT(WriteFileDurably(path, path + ".tmp", "old"), IsOk());
  ASSERT_THAT(WriteFileDurably(path, path + ".tmp", "new"), IsOk());
  EXPECT_EQ(*ReadWholeFile(path, 3), "new");
  EXPECT_THAT(ReadWholeFile(path, 2), StatusIs(absl::StatusCode::kDataLoss, _));
  EXPECT_THAT(NamesIn(folder.Path("")), SizeIs(1));
}

TEST(FilesTest, WhatCannotBeWrittenSaysWhichFile) {
  const TemporaryFolder folder;
  const std::string path = folder.Path("none/file");
  EXPECT_THAT(WriteFileDurably(path, folder.Path("tmp"), "x"),
              StatusIs(absl::StatusCode::kNotFound, testing::HasSubstr("tmp")));
  EXPECT_THAT(NamesIn(folder.Path("")), IsEmpty());
  EXPECT_THAT(ReadWholeFile(path, 1),
              StatusIs(absl::StatusCode::kNotFound, testing::HasSubstr(path)));
}

TEST(FilesTest, AFullDiskIsAnErrorOfItsOwnAndLeavesNothing) {
  const TemporaryFolder folder;
  // No file may be larger than 10 bytes: the system says so as of a full disk.
  rlimit before = {};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small = {10, before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  const absl::Status status = WriteFileDurably(
      folder.Path("file"), folder.Path("tmp"), std::string(100, 'x'));
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_THAT(status, StatusIs(absl::StatusCode::kResourceExhausted, _));
  EXPECT_THAT(NamesIn(folder.Path("")), IsEmpty());
}

TEST(FilesTest, AFolderCannotBeMadeBelowAFile) {
  const TemporaryFolder folder;
  const std::string path = folder.Path("file");
  ASSERT_THAT(WriteFileDurably(path, path + ".tmp", ""), IsOk());
  EXPECT_THAT(
      MakeFolder(path + "/below"),
      StatusIs(absl::StatusCode::kUnavailable, testing::HasSubstr(path)));
  EXPECT_THAT(MakeFolder(folder.Path("a/b/c")), IsOk());
  EXPECT_THAT(MakeFolder(folder.Path("a/b/c")), IsOk());
}

TEST(FilesTest, AFolderIsLockedOnce) {
  const TemporaryFolder folder;
  {
    const auto lock = FolderLock::Take(folder.Path(""));
    ASSERT_THAT(lock, IsOk());
    EXPECT_THAT(FolderLock::Take(folder.Path("")),
                StatusIs(absl::StatusCode::kFailedPrecondition,
                         testing::HasSubstr(folder.Path(""))));
  }
  EXPECT_THAT(FolderLock::Take(folder.Path("")), IsOk());
  EXPECT_THAT(FolderLock::Take(folder.Path("none")),
              StatusIs(absl::StatusCode::kNotFound, _));
}

}  // namespace
}  // namespace isomatch
