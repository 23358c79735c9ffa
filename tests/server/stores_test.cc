#include "server/stores.h"

#include <filesystem>
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "core/base/sha256.h"
#include "tests/support/matchers.h"
#include "tests/support/small_disk.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

namespace fs = std::filesystem;

ServerConfig ConfigOf(const std::string& folder) {
  ServerConfig config;
  config.data_dir = folder;
  return config;
}

void WriteBelow(const std::string& path, const std::string& bytes) {
  fs::create_directories(fs::path(path).parent_path());
  std::ofstream(path) << bytes;
}

/// As version 1 left it: nothing is in reserve.
class FullUpgradeTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!disk_.problem().empty()) GTEST_SKIP() << disk_.problem();
    for (const char* store : {"blobs", "prepared"}) {
      fs::create_directories(absl::StrCat(folder_, "/", store, "/.tmp"));
    }
    std::ofstream(folder_ + "/lock").flush();
    fs::copy(fs::path(ISOMATCH_STORAGE_DATA) / "version1" / "jobs.sqlite",
             folder_);
  }

  const SmallDisk disk_{/*mebibytes=*/2};
  const std::string folder_ = disk_.Path("data");
};

TEST_F(FullUpgradeTest, DoesWithoutWhatWasPrepared) {
  const std::string prepared =
      absl::StrCat(folder_, "/prepared/default/ab/", Sha256Hex("prepared"));
  WriteBelow(prepared, std::string(300000, 'p'));
  disk_.Fill();
  const auto stores = OpenStores(ConfigOf(folder_));
  ASSERT_THAT(stores, IsOk());
  EXPECT_THAT(*stores->jobs->List({}), testing::SizeIs(3));
  EXPECT_FALSE(fs::exists(prepared));
}

TEST_F(FullUpgradeTest, DoesWithTheRoomOfWhatWasHalfWritten) {
  const std::string prepared =
      absl::StrCat(folder_, "/prepared/default/ab/", Sha256Hex("prepared"));
  WriteBelow(prepared, "prepared");
  WriteBelow(folder_ + "/blobs/.tmp/7", std::string(300000, 'h'));
  disk_.Fill();
  const auto stores = OpenStores(ConfigOf(folder_));
  ASSERT_THAT(stores, IsOk());
  EXPECT_THAT(*stores->jobs->List({}), testing::SizeIs(3));
  EXPECT_TRUE(fs::exists(prepared));
}

class LastSeenTest : public testing::Test {
 protected:
  std::optional<absl::Time> LastSeen() const {
    const auto stores = OpenStores(config_);
    EXPECT_THAT(stores, IsOk());
    return stores->last_seen;
  }

  TemporaryFolder folder_;
  const ServerConfig config_ = ConfigOf(folder_.Path("data"));
};

TEST_F(LastSeenTest, IsWhatWasSavedOrElseWhatJobsTell) {
  EXPECT_EQ(LastSeen(), std::nullopt);
  const absl::Time time = absl::FromUnixSeconds(1'800'000'000);
  {
    const auto stores = OpenStores(config_);
    ASSERT_THAT(stores, IsOk());
    JobRecord record;
    record.id = "job";
    record.create_time = time;
    ASSERT_THAT(stores->jobs->Insert(record), IsOk());
  }
  EXPECT_EQ(LastSeen(), time);  // as after an upgrade
  const RetentionClock::Environment clock = MakeClockEnvironment(config_);
  // The job is of a time when the clock was days ahead, and not believed.
  clock.save(time - absl::Hours(200));
  EXPECT_EQ(LastSeen(), time - absl::Hours(200));
}

TEST_F(LastSeenTest, NothingIsSavedWithoutAFolder) {
  ServerConfig config = config_;
  config.ephemeral = true;
  fs::create_directory(config.data_dir);
  MakeClockEnvironment(config).save(absl::UnixEpoch());
  EXPECT_TRUE(fs::is_empty(config.data_dir));
}

}  // namespace
}  // namespace isomatch
