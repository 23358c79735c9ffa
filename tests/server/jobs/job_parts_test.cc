// What becomes of the parts of results that JobManager stores.

#include <new>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/sha256.h"
#include "tests/server/jobs/job_manager_fixture.h"

namespace isomatch {
namespace {

class JobPartsTest : public JobManagerTest {};

TEST_F(JobPartsTest, EveryPartIsStoredAndLetGoWithTheJob) {
  found_ = AllParts();
  const std::string id = Create();
  EXPECT_TRUE(workers_.RunNext());
  const JobRecord record = manager_->Get(caller_, id)->record;
  ASSERT_TRUE(record.result);
  ASSERT_EQ(record.result->parts.size(), 5);
  for (const StoredPart& part : record.result->parts) {
    const auto found = manager_->GetPart(caller_, id, part.part);
    ASSERT_THAT(found, IsOk()) << ResultPartName(part.part);
    EXPECT_EQ(Sha256Hex(*found->bytes), part.sha256);
  }
  EXPECT_FALSE(AllRoomIsFree());
  ASSERT_THAT(manager_->Delete(caller_, id), IsOk());
  EXPECT_TRUE(AllRoomIsFree());
}

TEST_F(JobPartsTest, EqualPartsOfTwoJobsAreLetGoWithTheLast) {
  found_ = AllParts();
  const std::string first = Create();
  const std::string second = Create();
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_TRUE(workers_.RunNext());
  ASSERT_THAT(manager_->Delete(caller_, first), IsOk());
  EXPECT_FALSE(AllRoomIsFree());
  EXPECT_THAT(manager_->GetPart(caller_, second, ResultPart::kConfidence),
              IsOk());
  ASSERT_THAT(manager_->Delete(caller_, second), IsOk());
  EXPECT_TRUE(AllRoomIsFree());
}

TEST_F(JobPartsTest, PartsThatComeAfterTheCancelAreLetGo) {
  found_ = AllParts();
  const std::string id = Create();
  during_match_ = [&](const std::stop_token&) {
    return manager_->Cancel(caller_, id).status();
  };
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_TRUE(AllRoomIsFree());
}

TEST_F(JobPartsTest, APartWithoutRoomFailsTheJobAndLetsGoOfTheOthers) {
  found_ = AllParts();
  found_.alternatives[0].y_from_x.resize(kBlobBytes / 4);  // with the map: > 1
  const std::string id = Create();
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(id), "FAILED");
  EXPECT_EQ(FailureOf(id), "STORAGE_FAILED");
  EXPECT_TRUE(AllRoomIsFree());
}

TEST_F(JobPartsTest, APartThatFindsNoMemoryFailsItsJobOnly) {
  found_ = AllParts();
  const std::string bad = Create();
  const std::string good = Create();
  int puts = 0;
  blobs_.before_put = [&] {
    if (++puts == 3) throw std::bad_alloc();
  };
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(bad), "FAILED");
  EXPECT_EQ(FailureOf(bad), "OUT_OF_MEMORY");
  EXPECT_TRUE(AllRoomIsFree());
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(good), "SUCCEEDED");
}

TEST_F(JobPartsTest, OnlySoManyTerminalJobsAreKeptWithTheirResults) {
  Restart({.max_kept_jobs = 2});
  for (int i = 0; i < 5; ++i) {
    Create();
    EXPECT_TRUE(workers_.RunNext());
  }
  EXPECT_EQ(manager_->List(caller_, {})->size(), 2);
  EXPECT_EQ(StateOf("job3"), "GONE");
  EXPECT_EQ(StateOf("job4"), "SUCCEEDED");
  // The results that are gone may be evicted: a blob of all their room fits.
  EXPECT_THAT(
      blobs_.Put({"", "x"}, std::string((1 << 20) - 8, 'x'), Keep::kWhileRoom),
      IsOk());
}

}  // namespace
}  // namespace isomatch
