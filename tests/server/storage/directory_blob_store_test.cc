#include "server/storage/directory_blob_store.h"

#include <sys/resource.h>
#include <sys/stat.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/sha256.h"
#include "server/storage/files.h"
#include "tests/support/matchers.h"
#include "tests/support/small_disk.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::_;
using testing::IsEmpty;
using testing::SizeIs;

BlobKey KeyOf(const std::string& bytes) { return {"tenant", Sha256Hex(bytes)}; }

auto IsGone() { return StatusIs(absl::StatusCode::kNotFound, _); }

/// The files below the folder, whatever they are.
std::vector<std::string> FilesBelow(const std::string& folder) {
  std::vector<std::string> files;
  for (const auto& entry :
       std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) files.push_back(entry.path().string());
  }
  return files;
}

class DirectoryBlobStoreTest : public testing::Test {
 protected:
  void Open(std::int64_t capacity_bytes = 100) {
    store_.reset();
    auto store = DirectoryBlobStore::Open(root_, capacity_bytes);
    ASSERT_THAT(store, IsOk());
    store_ = *std::move(store);
  }

  TemporaryFolder folder_;
  const std::string root_ = folder_.Path("blobs");
  std::unique_ptr<DirectoryBlobStore> store_;
};

TEST_F(DirectoryBlobStoreTest, BlobsAreThereAfterOpeningAgain) {
  Open();
  ASSERT_THAT(store_->Put(KeyOf("one"), "one", Keep::kPinned), IsOk());
  ASSERT_THAT(store_->Put(KeyOf("two"), "two", Keep::kWhileRoom), IsOk());
  Open();
  EXPECT_EQ(**store_->Get(KeyOf("one")), "one");
  EXPECT_EQ(**store_->Get(KeyOf("two")), "two");
  EXPECT_EQ(store_->size_bytes(), 6);
  EXPECT_THAT(FilesBelow(root_), SizeIs(2));
}

TEST_F(DirectoryBlobStoreTest, ADamagedFileIsAsGoodAsMissing) {
  Open();
  ASSERT_THAT(store_->Put(KeyOf("whole"), "whole", Keep::kWhileRoom), IsOk());
  std::ofstream(FilesBelow(root_).front()) << "whale";
  EXPECT_THAT(store_->Get(KeyOf("whole")), IsGone());
  EXPECT_FALSE(store_->Has(KeyOf("whole")));
  ASSERT_THAT(store_->Put(KeyOf("whole"), "whole", Keep::kWhileRoom), IsOk());
  EXPECT_EQ(**store_->Get(KeyOf("whole")), "whole");
  EXPECT_EQ(store_->size_bytes(), 5);
}

TEST_F(DirectoryBlobStoreTest, AFileThatCannotBeReadNowIsNotDamaged) {
  Open();
  ASSERT_THAT(store_->Put(KeyOf("whole"), "whole", Keep::kWhileRoom), IsOk());
  rlimit before;
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &before), 0);
  rlimit none = before;
  none.rlim_cur = 0;
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &none), 0);
  const auto blob = store_->Get(KeyOf("whole"));
  const bool is_put =
      store_->Put(KeyOf("whole"), "whole", Keep::kWhileRoom).ok();
  const bool is_whole = store_->HasWhole(KeyOf("whole"));
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &before), 0);
  EXPECT_THAT(blob, StatusIs(absl::StatusCode::kUnavailable,
                             testing::HasSubstr(root_)));
  EXPECT_TRUE(is_put);
  EXPECT_TRUE(is_whole);
  EXPECT_TRUE(store_->Has(KeyOf("whole")));
  EXPECT_THAT(store_->Get(KeyOf("whole")), IsOk());
}

/// Opens, but reading it is an input/output error, as of a bad sector.
void PutOnABadSector(const std::string& file) {
  std::filesystem::remove(file);
  std::filesystem::create_symlink("/proc/self/mem", file);
}

TEST_F(DirectoryBlobStoreTest, ABadSectorIsDamageThatTheSameBytesHeal) {
  Open();
  for (const bool is_looked_at : {false, true}) {
    ASSERT_THAT(store_->Put(KeyOf("whole"), "whole", Keep::kPinned), IsOk());
    PutOnABadSector(FilesBelow(root_).front());
    if (is_looked_at) {
      EXPECT_FALSE(store_->HasWhole(KeyOf("whole")));
    }
    ASSERT_THAT(store_->Put(KeyOf("whole"), "whole", Keep::kPinned), IsOk());
    EXPECT_EQ(*ReadWholeFile(FilesBelow(root_).front(), 5), "whole");
    EXPECT_EQ(**store_->Get(KeyOf("whole")), "whole");
  }
}

TEST_F(DirectoryBlobStoreTest, WhatCannotBeReadIsWrittenAgainIfThatGoes) {
  Open();
  ASSERT_THAT(store_->Put(KeyOf("whole"), "whole", Keep::kPinned), IsOk());
  const std::string file = FilesBelow(root_).front();
  std::filesystem::remove(file);
  ASSERT_EQ(mknod(file.c_str(), S_IFSOCK | S_IRUSR, 0), 0);
  EXPECT_THAT(store_->Get(KeyOf("whole")),
              StatusIs(absl::StatusCode::kUnavailable, _));
  ASSERT_THAT(store_->Put(KeyOf("whole"), "whole", Keep::kPinned), IsOk());
  EXPECT_EQ(**store_->Get(KeyOf("whole")), "whole");
}

TEST_F(DirectoryBlobStoreTest, WhatCouldNotBeReadAtTheStartIsFoundLater) {
  Open();
  for (const char* bytes : {"one", "two", "three"}) {
    ASSERT_THAT(store_->Put(KeyOf(bytes), bytes, Keep::kWhileRoom), IsOk());
  }
  std::filesystem::rename(root_ + "/tenant", folder_.Path("away"));
  std::filesystem::create_symlink("tenant", root_ + "/tenant");  // a loop
  absl::Status looking = absl::UnavailableError("input/output error");
  std::vector<std::string> told;
  store_.reset();
  auto store = DirectoryBlobStore::Open(
      root_, 100,
      {.look = [&](const std::string& path) -> absl::StatusOr<FileAbout> {
         if (!looking.ok()) return looking;
         return AboutFile(path);
       },
       .on_unreadable = [&](const std::string& folder,
                            auto&&) { told.push_back(folder); }});
  ASSERT_THAT(store, IsOk());
  EXPECT_THAT(told, testing::ElementsAre(root_ + "/tenant"));
  EXPECT_THAT((*store)->Get(KeyOf("one")),
              StatusIs(absl::StatusCode::kUnavailable, _));
  EXPECT_FALSE((*store)->Pin(KeyOf("one")));
  looking = absl::OkStatus();
  EXPECT_THAT((*store)->Get(KeyOf("one")), IsGone());
  std::filesystem::remove(root_ + "/tenant");
  std::filesystem::rename(folder_.Path("away"), root_ + "/tenant");
  EXPECT_EQ(**(*store)->Get(KeyOf("one")), "one");
  EXPECT_TRUE((*store)->Pin(KeyOf("two")));
  EXPECT_TRUE((*store)->HasWhole(KeyOf("three")));
  EXPECT_EQ((*store)->size_bytes(), 11);
  (*store)->Remove(KeyOf("three"));
  EXPECT_FALSE((*store)->Has(KeyOf("three")));
}

TEST_F(DirectoryBlobStoreTest, RemovingFindsAFileToo) {
  Open();
  ASSERT_THAT(store_->Put(KeyOf("one"), "one", Keep::kWhileRoom), IsOk());
  std::filesystem::rename(root_ + "/tenant", folder_.Path("away"));
  Open();
  std::filesystem::rename(folder_.Path("away"), root_ + "/tenant");
  store_->Remove(KeyOf("one"));
  EXPECT_THAT(FilesBelow(root_), IsEmpty());
}

TEST_F(DirectoryBlobStoreTest, OnlyNamesOfBlobsAreLookedFor) {
  Open();
  std::filesystem::create_directory(root_ + "/tenant");
  std::ofstream(root_ + "/tenant/secret") << "secret";
  for (const std::string name : {"./secret", "..", ""}) {
    EXPECT_FALSE(store_->Has({"tenant", name}));
    EXPECT_THAT(store_->Get({"tenant", name}), IsGone());
  }
}

TEST_F(DirectoryBlobStoreTest, WhatIsPinnedBeforeItIsThereTakesNobodysPin) {
  Open();
  store_->PinWhenThere(KeyOf("late"));
  EXPECT_FALSE(store_->Has(KeyOf("late")));
  EXPECT_THAT(store_->Get(KeyOf("late")), IsGone());
  EXPECT_EQ(store_->size_bytes(), 0);
  ASSERT_THAT(store_->Put(KeyOf("late"), "late", Keep::kPinned), IsOk());
  store_->Unpin(KeyOf("late"));  // of the first
  store_->Remove(KeyOf("late"));
  EXPECT_EQ(**store_->Get(KeyOf("late")), "late");
  store_->Unpin(KeyOf("late"));
  store_->Remove(KeyOf("late"));
  EXPECT_FALSE(store_->Has(KeyOf("late")));
}

TEST_F(DirectoryBlobStoreTest, APinnedFileThatWasDamagedCanBePutAgain) {
  Open();
  ASSERT_THAT(store_->Put(KeyOf("whole"), "whole", Keep::kPinned), IsOk());
  std::filesystem::remove(FilesBelow(root_).front());
  EXPECT_THAT(store_->Get(KeyOf("whole")), IsGone());
  EXPECT_TRUE(store_->MakeTenantRoom(KeyOf("whole"), 5, 5));  // it has its room
  ASSERT_THAT(store_->Put(KeyOf("whole"), "whole", Keep::kPinned), IsOk());
  EXPECT_EQ(**store_->Get(KeyOf("whole")), "whole");
  store_->Remove(KeyOf("whole"));  // pinned
  EXPECT_TRUE(store_->Has(KeyOf("whole")));
  for (int i = 0; i < 2; ++i) store_->Unpin(KeyOf("whole"));
  store_->Remove(KeyOf("whole"));
  EXPECT_FALSE(store_->Has(KeyOf("whole")));
  EXPECT_THAT(FilesBelow(root_), IsEmpty());
}

TEST_F(DirectoryBlobStoreTest, WhatIsPutAgainHealsAFileThatWasDamagedUnseen) {
  const std::string long_bytes(200000, 'w');
  for (const std::string& damaged :
       {std::string("whale"), std::string(), long_bytes + "x",
        long_bytes.substr(1), "x" + long_bytes.substr(1)}) {
    Open(1000000);
    ASSERT_THAT(store_->Put(KeyOf(long_bytes), long_bytes, Keep::kPinned),
                IsOk());
    std::ofstream(FilesBelow(root_).front()) << damaged;
    ASSERT_THAT(store_->Put(KeyOf(long_bytes), long_bytes, Keep::kPinned),
                IsOk());
    EXPECT_EQ(**store_->Get(KeyOf(long_bytes)), long_bytes);
    EXPECT_EQ(store_->size_bytes(), 200000);
    for (int i = 0; i < 2; ++i) store_->Unpin(KeyOf(long_bytes));
    store_->Remove(KeyOf(long_bytes));
    EXPECT_FALSE(store_->Has(KeyOf(long_bytes)));
  }
}

TEST_F(DirectoryBlobStoreTest, AFileThatWasCutBeforeTheStartIsHealedToo) {
  Open();
  ASSERT_THAT(store_->Put(KeyOf("whole"), "whole", Keep::kWhileRoom), IsOk());
  std::filesystem::resize_file(FilesBelow(root_).front(), 2);
  Open();
  ASSERT_THAT(store_->Put(KeyOf("whole"), "whole", Keep::kWhileRoom), IsOk());
  EXPECT_EQ(**store_->Get(KeyOf("whole")), "whole");
  EXPECT_EQ(store_->size_bytes(), 5);
}

TEST_F(DirectoryBlobStoreTest, WhatIsGoneOrCutIsMissedWithoutReadingIt) {
  Open();
  ASSERT_THAT(store_->Put(KeyOf("whole"), "whole", Keep::kWhileRoom), IsOk());
  ASSERT_THAT(store_->Put(KeyOf("gone"), "gone", Keep::kWhileRoom), IsOk());
  for (const std::string& file : FilesBelow(root_)) {
    if (std::filesystem::file_size(file) == 4) {
      std::filesystem::remove(file);
    } else {
      std::filesystem::resize_file(file, 2);
    }
  }
  EXPECT_FALSE(store_->Has(KeyOf("whole")));
  EXPECT_FALSE(store_->Has(KeyOf("gone")));
}

TEST_F(DirectoryBlobStoreTest, WholeIsWhatHasItsDigest) {
  Open();
  ASSERT_THAT(store_->Put(KeyOf("whole"), "whole", Keep::kWhileRoom), IsOk());
  std::ofstream(FilesBelow(root_).front()) << "whale";
  EXPECT_TRUE(store_->Has(KeyOf("whole")));
  EXPECT_FALSE(store_->HasWhole(KeyOf("whole")));
  EXPECT_FALSE(store_->Has(KeyOf("whole")));
}

TEST_F(DirectoryBlobStoreTest, AReaderOfDamagedBytesLeavesTheNextOnesAlone) {
  std::unique_ptr<DirectoryBlobStore> store;
  int reads = 0;
  auto opened = DirectoryBlobStore::Open(
      root_, 100, {.read = [&](const std::string& path, std::int64_t most) {
        auto bytes = ReadWholeFile(path, most);
        if (++reads == 1) {  // damaged; somebody evicts it and puts it again
          bytes = "whale";
          store->Remove(KeyOf("whole"));
          EXPECT_THAT(store->Put(KeyOf("whole"), "whole", Keep::kWhileRoom),
                      IsOk());
        }
        return bytes;
      }});
  ASSERT_THAT(opened, IsOk());
  store = *std::move(opened);
  ASSERT_THAT(store->Put(KeyOf("whole"), "whole", Keep::kWhileRoom), IsOk());
  EXPECT_EQ(**store->Get(KeyOf("whole")), "whole");
  EXPECT_TRUE(store->Has(KeyOf("whole")));
  EXPECT_EQ(reads, 2);
}

TEST_F(DirectoryBlobStoreTest, HalfWrittenFilesAreRemovedAndOthersLeftAlone) {
  Open();
  std::ofstream(root_ + "/.tmp/7") << "half";
  std::ofstream(root_ + "/notes.txt") << "mine";
  Open();
  EXPECT_THAT(FilesBelow(root_), testing::ElementsAre(root_ + "/notes.txt"));
}

TEST_F(DirectoryBlobStoreTest, WhatCannotBeLookedAtDoesNotEndTheStart) {
  Open();
  ASSERT_THAT(store_->Put(KeyOf("one"), "one", Keep::kWhileRoom), IsOk());
  const std::string loop = Sha256Hex("loop");
  const std::string there = root_ + "/tenant/" + loop.substr(0, 2);
  std::filesystem::create_directories(there);
  std::filesystem::create_symlink(loop, there + "/" + loop);
  std::filesystem::create_symlink("nowhere", root_ + "/broken");
  Open();
  EXPECT_EQ(**store_->Get(KeyOf("one")), "one");
  EXPECT_FALSE(store_->Has(KeyOf("loop")));
  ASSERT_THAT(store_->Put(KeyOf("loop"), "loop", Keep::kWhileRoom), IsOk());
  EXPECT_EQ(**store_->Get(KeyOf("loop")), "loop");
}

TEST_F(DirectoryBlobStoreTest, TryingToWriteLeavesNothing) {
  Open();
  EXPECT_THAT(store_->TryWriting(1000), IsOk());
  EXPECT_THAT(FilesBelow(root_), IsEmpty());
  EXPECT_EQ(store_->size_bytes(), 0);
}

TEST_F(DirectoryBlobStoreTest, EvictedBlobsLeaveTheDisk) {
  Open();
  for (char fill = 'a'; fill < 'k'; ++fill) {
    const std::string bytes(40, fill);
    ASSERT_THAT(store_->Put(KeyOf(bytes), bytes, Keep::kWhileRoom), IsOk());
  }
  EXPECT_THAT(FilesBelow(root_), SizeIs(2));
}

TEST_F(DirectoryBlobStoreTest, ASmallerCapacityHoldsOnceRoomIsNeeded) {
  Open(1000);
  for (char fill = 'a'; fill < 'k'; ++fill) {
    const std::string bytes(40, fill);
    ASSERT_THAT(store_->Put(KeyOf(bytes), bytes, Keep::kWhileRoom), IsOk());
  }
  Open(100);
  EXPECT_EQ(store_->size_bytes(), 400);
  ASSERT_THAT(store_->Put(KeyOf("x"), "x", Keep::kWhileRoom), IsOk());
  EXPECT_LE(store_->size_bytes(), 100);
}

TEST_F(DirectoryBlobStoreTest, ARefusingDiskLeavesNothingBehind) {
  absl::Status disk;
  auto store = DirectoryBlobStore::Open(
      root_, 100,
      {.write = [&](const std::string& path, const std::string& temporary,
                    absl::string_view bytes) {
        return disk.ok() ? WriteFileDurably(path, temporary, bytes) : disk;
      }});
  ASSERT_THAT(store, IsOk());
  disk = absl::ResourceExhaustedError("full");
  EXPECT_THAT((*store)->Put(KeyOf("a"), "a", Keep::kPinned),
              StatusIs(absl::StatusCode::kResourceExhausted, _));
  EXPECT_FALSE((*store)->Has(KeyOf("a")));
  EXPECT_EQ((*store)->size_bytes(), 0);
  EXPECT_THAT(FilesBelow(root_), IsEmpty());
  disk = absl::OkStatus();
  EXPECT_THAT((*store)->Put(KeyOf("a"), "a", Keep::kPinned), IsOk());
}

TEST_F(DirectoryBlobStoreTest, AFileThatOthersEvictBeforeItCountsStays) {
  std::unique_ptr<DirectoryBlobStore> store;
  int writes = 0;
  auto opened = DirectoryBlobStore::Open(
      root_, 20,
      {.write = [&](const std::string& path, const std::string& temporary,
                    absl::string_view bytes) {
        const absl::Status written = WriteFileDurably(path, temporary, bytes);
        if (++writes == 1) {
          // Another puts the same; then somebody needs the room.
          EXPECT_THAT(store->Put(KeyOf("same"), "same", Keep::kWhileRoom),
                      IsOk());
          const std::string large(13, 'l');
          EXPECT_THAT(store->Put(KeyOf(large), large, Keep::kWhileRoom),
                      IsOk());
        }
        return written;
      }});
  ASSERT_THAT(opened, IsOk());
  store = *std::move(opened);
  ASSERT_THAT(store->Put(KeyOf("same"), "same", Keep::kPinned), IsOk());
  EXPECT_EQ(writes, 3);
  EXPECT_EQ(**store->Get(KeyOf("same")), "same");
}

TEST_F(DirectoryBlobStoreTest, ManyThreadsGetWhatWasPut) {
  Open(300);
  const auto work = [&](int seed) {
    for (int i = 0; i < 200; ++i) {
      const std::string bytes(static_cast<size_t>(30 + (seed + i) % 7), 'b');
      if (!store_->Put(KeyOf(bytes), bytes, Keep::kWhileRoom).ok()) continue;
      const auto found = store_->Get(KeyOf(bytes));
      EXPECT_TRUE(!found.ok() || **found == bytes);
    }
  };
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) threads.emplace_back(work, i);
  for (std::thread& thread : threads) thread.join();
  EXPECT_LE(store_->size_bytes(), 300);
}

TEST_F(DirectoryBlobStoreTest, WhatIsPutWhileItIsRemovedIsThere) {
  std::unique_ptr<DirectoryBlobStore> store;
  std::thread putting;
  std::atomic<bool> is_put = false;
  auto opened = DirectoryBlobStore::Open(
      root_, 300, {.remove = [&](const std::string& path) {
        EXPECT_TRUE(store->Has(KeyOf("other")));  // nobody waits for this
        putting = std::thread([&] {
          EXPECT_THAT(store->Put(KeyOf("same"), "same", Keep::kPinned), IsOk());
          is_put = true;
        });
        // It would be there by then, most likely, if it were not held up.
        for (int i = 0; i < 20 && !is_put; ++i) {
          std::this_thread::sleep_for(std::chrono::milliseconds(10));
        }
        RemoveFile(path);
      }});
  ASSERT_THAT(opened, IsOk());
  store = *std::move(opened);
  ASSERT_THAT(store->Put(KeyOf("other"), "other", Keep::kWhileRoom), IsOk());
  ASSERT_THAT(store->Put(KeyOf("same"), "same", Keep::kWhileRoom), IsOk());
  store->Remove(KeyOf("same"));
  putting.join();
  EXPECT_EQ(**store->Get(KeyOf("same")), "same");
  EXPECT_THAT(FilesBelow(root_), SizeIs(2));
}

TEST(DirectoryBlobStoreRoomTest, RoomIsTriedWithoutTakingIt) {
  const SmallDisk disk(/*mebibytes=*/3);
  if (!disk.problem().empty()) GTEST_SKIP() << disk.problem();
  auto store = DirectoryBlobStore::Open(disk.Path("blobs"), 100);
  ASSERT_THAT(store, IsOk());
  EXPECT_THAT((*store)->TryWriting(2 << 20), IsOk());
  EXPECT_THAT((*store)->TryWriting(std::int64_t{1} << 40),
              StatusIs(absl::StatusCode::kResourceExhausted, _));
  EXPECT_THAT((*store)->TryWriting(2 << 20), IsOk());
  disk.Fill();
  EXPECT_THAT((*store)->TryWriting(0),
              StatusIs(absl::StatusCode::kResourceExhausted, _));
  EXPECT_THAT(FilesBelow(disk.Path("blobs")), IsEmpty());
}

}  // namespace
}  // namespace isomatch
