#include "server/postgres/blob_folder.h"

#include <chrono>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/sha256.h"
#include "server/postgres/postgres_blob_store.h"
#include "server/storage/files.h"
#include "tests/server/postgres/blob_database.h"
#include "tests/server/storage/blob_store_conformance.h"
#include "tests/support/matchers.h"
#include "tests/support/small_disk.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

namespace fs = std::filesystem;
using testing::_;

class BlobFolderTest : public testing::Test {
 protected:
  std::unique_ptr<PostgresBlobStore> Make(const std::string& folder) {
    PostgresBlobStore::Options options = ExactOptions(10 << 20);
    options.folder = folder;
    return std::make_unique<PostgresBlobStore>(database_.pool(), options);
  }
  std::unique_ptr<PostgresBlobStore> Make() { return Make(folder_.Path("")); }

  static BlobKey KeyOf(const std::string& bytes) {
    return {"tenant", Sha256Hex(bytes)};
  }

  static BlobKey Put(BlobStore& store, const std::string& bytes) {
    BlobKey key = KeyOf(bytes);
    EXPECT_THAT(store.Put(key, bytes, Keep::kWhileRoom), IsOk());
    return key;
  }

  /// Returns the files of blobs.
  std::vector<fs::path> Files() const {
    std::vector<fs::path> files;
    for (const auto& entry :
         fs::recursive_directory_iterator(folder_.Path(""))) {
      const bool is_mark = entry.path().filename() == "isomatch-blobs";
      if (entry.is_regular_file() && !is_mark) files.push_back(entry.path());
    }
    return files;
  }

  static void MakeOlder(const fs::path& file, std::chrono::hours age) {
    fs::last_write_time(file, fs::last_write_time(file) - age);
  }

  TemporaryFolder folder_;
  BlobDatabase database_;
};

TEST_F(BlobFolderTest, ContentIsInAFileThatGoesWithItsRow) {
  const auto store = Make();
  const BlobKey key = Put(*store, "content");
  ASSERT_EQ(Files().size(), 1);
  const std::string file = Files()[0].lexically_relative(folder_.Path(""));
  EXPECT_EQ(database_.Do("SELECT file FROM isomatch.blobs"), file);
  EXPECT_EQ(
      file.rfind("tenant/" + key.sha256.substr(0, 2) + "/" + key.sha256 + ".",
                 0),
      0);
  EXPECT_EQ(database_.Do("SELECT count(*) FROM isomatch.blob_chunks"), "0");
  EXPECT_EQ(**Make()->Get(key), "content");
  Make()->Remove(key);
  EXPECT_THAT(store->Get(key), IsMissingBlob());
  EXPECT_TRUE(Files().empty());
  EXPECT_EQ(database_.Do("SELECT count(*) FROM isomatch.dropped_files"), "0");
}

TEST_F(BlobFolderTest, WhatMakesRoomGoesWithItsFile) {
  const auto store = Make();
  Put(*store, std::string(6 << 20, 'a'));
  Put(*store, std::string(6 << 20, 'b'));
  EXPECT_EQ(Files().size(), 1);
}

TEST_F(BlobFolderTest, AFolderMayComeAndGo) {
  const auto without = Make("");
  const BlobKey row = Put(*without, "in a row");
  const auto with = Make();
  EXPECT_EQ(**with->Get(row), "in a row");
  const BlobKey file = Put(*with, "in a file");
  EXPECT_THAT(without->Get(file), StatusIs(absl::StatusCode::kUnavailable, _));
  PostgresBlobStore::Options options = ExactOptions(100);
  options.folder = folder_.Path("");
  options.puts_into_folder = false;
  PostgresBlobStore reading(database_.pool(), options);
  EXPECT_EQ(**reading.Get(file), "in a file");
  Put(reading, "new");
  EXPECT_EQ(Files().size(), 1);
  reading.Remove(file);
  EXPECT_TRUE(Files().empty());
}

TEST_F(BlobFolderTest, ManyMayPutTheSameAtOnce) {
  const auto one = Make();
  const auto two = Make();
  const std::string bytes(1 << 20, 'a');
  const BlobKey key = KeyOf(bytes);
  for (int round = 0; round < 5; ++round) {
    {
      std::vector<std::jthread> threads;
      for (BlobStore* store : {one.get(), two.get(), one.get(), two.get()}) {
        threads.emplace_back([store, &bytes, &key] {
          EXPECT_THAT(store->Put(key, bytes, Keep::kPinned), IsOk());
          EXPECT_THAT(store->Get(key), IsOk());
        });
      }
    }
    EXPECT_EQ(Files().size(), 1);
    one->Remove(key);
    EXPECT_TRUE(Files().empty());
  }
}

TEST_F(BlobFolderTest, ADamagedOrMissingFileIsAMissingBlob) {
  const auto store = Make();
  for (const auto damage :
       {+[](const fs::path& file) { std::ofstream(file) << "CONTENT"; },
        +[](const fs::path& file) { std::ofstream(file) << "con"; },
        +[](const fs::path& file) { std::ofstream(file) << "longer content"; },
        +[](const fs::path& file) { fs::remove(file); }}) {
    const BlobKey key = Put(*store, "content");
    ASSERT_EQ(Files().size(), 1);
    damage(Files()[0]);
    EXPECT_THAT(store->Get(key), IsMissingBlob());
    EXPECT_FALSE(Make()->Has(key));
    Put(*store, "content");
    EXPECT_EQ(**store->Get(key), "content");
    store->Tidy();
    EXPECT_EQ(Files().size(), 1);
    store->Remove(key);
  }
}

// A process was killed between file and row, or while it wrote.
TEST_F(BlobFolderTest, FilesWithoutARowGoAfterADay) {
  const BlobKey key = Put(*Make(), "content");
  const fs::path kept = Files()[0];
  const std::string folder = kept.parent_path();
  std::ofstream(folder + "/" + key.sha256 + ".0123456789abcdef") << "content";
  std::ofstream(folder + "/" + key.sha256 + ".0123456789abcdef.new") << "c";
  std::ofstream(folder + "/notes.txt") << "not ours";
  for (const fs::path& file : Files()) MakeOlder(file, std::chrono::hours(23));
  Make()->Tidy();
  EXPECT_EQ(Files().size(), 4);
  for (const fs::path& file : Files()) MakeOlder(file, std::chrono::hours(2));
  Make()->Tidy();
  EXPECT_EQ(Files().size(), 2);
  EXPECT_TRUE(fs::exists(kept));
}

TEST_F(BlobFolderTest, WhatNobodyCouldRemoveYetTidyRemoves) {
  const BlobKey key = Put(*Make(), "content");
  Make("")->Remove(key);  // this one does not know the folder
  EXPECT_EQ(Files().size(), 1);
  Make()->Tidy();
  EXPECT_TRUE(Files().empty());
}

TEST_F(BlobFolderTest, WhileTheFolderIsAwayNothingIsLost) {
  const std::string path = folder_.Path("shared");
  fs::create_directory(path);
  const auto store = Make(path);
  const BlobKey key = Put(*store, "content");
  const auto is_unavailable = StatusIs(absl::StatusCode::kUnavailable, _);
  fs::rename(path, folder_.Path("away"));
  for (const bool is_mount_point : {false, true}) {
    SCOPED_TRACE(is_mount_point);
    if (is_mount_point) fs::create_directory(path);
    EXPECT_THAT(Make(path)->Check(), is_unavailable);
    EXPECT_THAT(Make(path)->Get(key), is_unavailable);
    EXPECT_THAT(store->Get(key), is_unavailable);
    EXPECT_THAT(store->Put(KeyOf("more"), "more", Keep::kPinned),
                is_unavailable);
    EXPECT_THAT(store->TryWriting(1), is_unavailable);
    Make("")->Remove(Put(*Make(folder_.Path("away")), "removed"));
    store->Tidy();
    EXPECT_EQ(database_.Do("SELECT count(*) FROM isomatch.dropped_files"), "1");
    Make(folder_.Path("away"))->Tidy();
    EXPECT_EQ(database_.Do("SELECT count(*) FROM isomatch.dropped_files"), "0");
  }
  fs::remove(path);  // still empty
  fs::rename(folder_.Path("away"), path);
  EXPECT_EQ(**store->Get(key), "content");
}

TEST_F(BlobFolderTest, AFullDiskIsNoRoom) {
  SmallDisk disk(1);
  if (!disk.problem().empty()) GTEST_SKIP() << disk.problem();
  const auto store = Make(disk.Path(""));
  const BlobKey key = Put(*store, "content");
  EXPECT_THAT(store->TryWriting(1000), IsOk());
  disk.Fill();
  const std::string bytes(100000, 'a');
  EXPECT_THAT(store->Put(KeyOf(bytes), bytes, Keep::kWhileRoom),
              StatusIs(absl::StatusCode::kResourceExhausted, _));
  EXPECT_THAT(store->TryWriting(100000),
              StatusIs(absl::StatusCode::kResourceExhausted, _));
  EXPECT_EQ(**store->Get(key), "content");
  disk.Empty();
  Put(*store, bytes);
}

}  // namespace
}  // namespace isomatch
