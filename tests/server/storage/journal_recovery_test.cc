// What a journal notices of a disk that is full, and of files that were cut or
// changed behind its back.

#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "server/storage/disk_reserve.h"
#include "server/storage/job_record_codec.h"
#include "server/storage/journal_mark.h"
#include "server/storage/memory_job_store.h"
#include "server/storage/sqlite_journal.h"
#include "tests/support/matchers.h"
#include "tests/support/small_disk.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::_;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

namespace fs = std::filesystem;

JobRecord JobNamed(const std::string& id) {
  JobRecord record;
  record.id = id;
  record.tenant = "tenant";
  record.labels = {{"name", id}};
  record.create_time = absl::UnixEpoch();
  return record;
}

void FlipBit(const std::string& path, std::int64_t offset) {
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  file.seekg(offset);
  const auto byte = static_cast<char>(file.get() ^ 4);
  file.seekp(offset);
  file.put(byte);
}

class JournalRecoveryTest : public testing::Test {
 protected:
  void Open() {
    journal_.reset();
    auto journal = SqliteJournal::Open(path_);
    ASSERT_THAT(journal, IsOk());
    journal_ = *std::move(journal);
  }

  /// Opens what a process that was killed would have left, with `damage` done.
  template <typename Damage>
  SqliteJournal::Contents LoadAfter(const Damage& damage) {
    const std::string copy = folder_.Path("copy");
    fs::remove_all(copy);
    fs::create_directory(copy);
    for (const auto& entry : fs::directory_iterator(folder_.Path("data"))) {
      if (entry.path().extension() == ".sqlite-shm") continue;
      fs::copy(entry.path(), copy / entry.path().filename());
    }
    damage(copy + "/jobs.sqlite");
    for (int i = 0; i < 2; ++i) {
      auto journal = SqliteJournal::Open(copy + "/jobs.sqlite");
      EXPECT_THAT(journal, IsOk());
      if (!journal.ok()) return {};
      auto contents = (*journal)->Load();
      EXPECT_THAT(contents, IsOk());
      if (!contents.ok()) return {};
      if (i == 0) {
        first_ = *std::move(contents);
      } else {  // it is told once
        EXPECT_EQ(contents->lost_jobs, 0);
        EXPECT_EQ(contents->lost_changes, 0);
      }
    }
    return first_;
  }

  void WriteJobs(int count) {
    Open();
    ASSERT_THAT(journal_->Load(), IsOk());
    for (int i = 0; i < count; ++i) {
      ASSERT_THAT(journal_->Write({JobNamed(absl::StrCat("job", i))}), IsOk());
    }
  }

  TemporaryFolder folder_;
  const std::string path_ =
      (fs::create_directory(folder_.Path("data")), folder_.Path("data")) +
      "/jobs.sqlite";
  std::unique_ptr<SqliteJournal> journal_;
  SqliteJournal::Contents first_;
};

TEST_F(JournalRecoveryTest, AKillLosesNothingAndNothingIsSaidToBeLost) {
  WriteJobs(4);
  ASSERT_THAT(journal_->Remove({"job1"}), IsOk());
  const auto contents = LoadAfter([](const std::string&) {});
  EXPECT_THAT(contents.records, SizeIs(3));
  EXPECT_EQ(contents.lost_jobs, 0);
  EXPECT_EQ(contents.lost_changes, 0);
}

TEST_F(JournalRecoveryTest, ALogThatIsGoneIsNoticed) {
  WriteJobs(4);
  const auto contents =
      LoadAfter([](const std::string& db) { fs::remove(db + "-wal"); });
  EXPECT_THAT(contents.records, IsEmpty());
  EXPECT_EQ(contents.lost_jobs, 4);
  EXPECT_EQ(contents.lost_changes, 4);
}

TEST_F(JournalRecoveryTest, ALogThatWasCutOrFlippedIsNoticed) {
  WriteJobs(4);
  const auto size = static_cast<std::int64_t>(fs::file_size(path_ + "-wal"));
  for (const std::int64_t at : {size - 1, size / 2, size - 5000}) {
    SCOPED_TRACE(at);
    auto contents = LoadAfter([&](const std::string& db) {
      fs::resize_file(db + "-wal", static_cast<std::uintmax_t>(at));
    });
    EXPECT_GT(contents.lost_changes, 0);
    EXPECT_EQ(contents.lost_jobs + std::ssize(contents.records), 4);
    contents =
        LoadAfter([&](const std::string& db) { FlipBit(db + "-wal", at); });
    EXPECT_GT(contents.lost_changes, 0);
    EXPECT_EQ(contents.lost_jobs + std::ssize(contents.records), 4);
  }
}

TEST_F(JournalRecoveryTest, AJobThatIsLostIsNotMadeUpForByOneThatIsBack) {
  WriteJobs(2);
  const auto size = fs::file_size(path_ + "-wal");
  ASSERT_THAT(journal_->Write({JobNamed("a"), JobNamed("b")}), IsOk());
  ASSERT_THAT(journal_->Remove({"job0", "job1"}), IsOk());
  const auto contents = LoadAfter(
      [&](const std::string& db) { fs::resize_file(db + "-wal", size); });
  EXPECT_THAT(contents.records, SizeIs(2));
  EXPECT_EQ(contents.lost_jobs, 2);
  EXPECT_EQ(contents.lost_changes, 2);
}

TEST_F(JournalRecoveryTest, AJobInThePlaceOfAnUnreadableOneIsNoLoss) {
  Open();
  JobRecord record = JobNamed("job0");
  record.request_id = "request";
  ASSERT_THAT(journal_->Write({record}), IsOk());
  journal_.reset();
  SQLite::Database(path_, SQLite::OPEN_READWRITE)
      .exec("UPDATE jobs SET record = x'00'");
  Open();
  EXPECT_THAT(journal_->Load()->unreadable, SizeIs(1));
  record.id = "job1";
  ASSERT_THAT(journal_->Write({record}), IsOk());
  const auto contents = LoadAfter([](const std::string&) {});
  EXPECT_THAT(contents.records, SizeIs(1));
  EXPECT_EQ(contents.lost_jobs, 0);
}

TEST_F(JournalRecoveryTest, WhatWasSettledIsNotLostWithTheLog) {
  WriteJobs(3);
  journal_->Settle();
  ASSERT_THAT(journal_->Write({JobNamed("late")}), IsOk());
  const auto contents =
      LoadAfter([](const std::string& db) { fs::remove(db + "-wal"); });
  EXPECT_THAT(contents.records, SizeIs(3));
  EXPECT_EQ(contents.lost_jobs, 1);
  EXPECT_EQ(contents.lost_changes, 1);
}

TEST_F(JournalRecoveryTest, AMarkThatLagsBehindOrIsDamagedTellsNothing) {
  WriteJobs(2);
  const auto lagging = LoadAfter([](const std::string& db) {
    JournalMark(db + ".mark").Write({1, 7});
  });
  EXPECT_EQ(lagging.lost_jobs, 0);
  const auto damaged =
      LoadAfter([](const std::string& db) { FlipBit(db + ".mark", 19); });
  EXPECT_EQ(damaged.lost_changes, 0);
  const auto gone =
      LoadAfter([](const std::string& db) { fs::remove(db + ".mark"); });
  EXPECT_THAT(gone.records, SizeIs(2));
  EXPECT_EQ(gone.lost_jobs, 0);
}

TEST_F(JournalRecoveryTest, ARecordThatIsNotWhatWasWrittenIsLeftOut) {
  WriteJobs(3);
  journal_.reset();  // all is in the database now
  {
    SQLite::Database database(path_, SQLite::OPEN_READWRITE);
    database.exec(
        "UPDATE jobs SET record = CAST(replace(record, 'job1', 'jobX') AS "
        "BLOB) "
        "WHERE id = 'job1'");
  }
  Open();
  const auto contents = journal_->Load();
  ASSERT_THAT(contents, IsOk());
  EXPECT_THAT(contents->records, SizeIs(2));
  EXPECT_THAT(contents->unreadable, ElementsAre("job1"));
  EXPECT_EQ(contents->lost_jobs, 0);
}

TEST_F(JournalRecoveryTest, EveryFlippedBitOfARecordIsNoticed) {
  WriteJobs(1);
  journal_.reset();
  std::ifstream file(path_, std::ios::binary);
  const std::string database{std::istreambuf_iterator<char>(file), {}};
  const std::string record = EncodeJobRecord(JobNamed("job0"));
  const auto begin = database.find(record.substr(0, 20));
  ASSERT_NE(begin, std::string::npos);
  for (size_t i = 0; i < record.size(); i += 17) {
    const auto contents = LoadAfter([&](const std::string& db) {
      FlipBit(db, static_cast<std::int64_t>(begin + i));
    });
    EXPECT_THAT(contents.records, IsEmpty());
    EXPECT_THAT(contents.unreadable, SizeIs(1));
  }
}

TEST_F(JournalRecoveryTest, VersionOneIsBroughtUp) {
  for (const char* file : {"jobs.sqlite", "jobs.sqlite-wal"}) {
    const fs::path from = fs::path(ISOMATCH_STORAGE_DATA) / "version1" / file;
    if (fs::exists(from)) fs::copy(from, folder_.Path("data"));
  }
  Open();
  const auto contents = journal_->Load();
  ASSERT_THAT(contents, IsOk());
  ASSERT_THAT(contents->records, SizeIs(3));
  EXPECT_THAT(contents->unreadable, IsEmpty());
  EXPECT_EQ(contents->records[0].state, JobState::kSucceeded);
  EXPECT_EQ(contents->records[0].labels.at("name"), "first");
  EXPECT_EQ(contents->records[1].state, JobState::kCancelled);
  EXPECT_EQ(contents->records[2].state, JobState::kFailed);
  ASSERT_THAT(journal_->Write({contents->records[2]}), IsOk());
  Open();
  EXPECT_THAT(journal_->Load()->records, SizeIs(3));
}

TEST(JobRecordTimesTest, WhatAClockSaysBeyondTheRangeIsTheNearest) {
  JobRecord record = JobNamed("a");
  record.create_time = absl::FromUnixSeconds(11'234'567'890);  // in 2326
  record.end_time = absl::FromUnixSeconds(-11'234'567'890);
  const auto decoded = DecodeJobRecord(EncodeJobRecord(record));
  ASSERT_THAT(decoded, IsOk());
  EXPECT_GT(decoded->create_time, absl::FromUnixSeconds(9'200'000'000));
  EXPECT_LT(decoded->create_time, record.create_time);
  EXPECT_LT(decoded->end_time, absl::FromUnixSeconds(-9'200'000'000));
}

TEST(JobRecordTextTest, WhatIsNotUtf8IsReplaced) {
  JobRecord record = JobNamed("a");
  record.labels = {{"k\xff", "v\xc3"}, {"good", "\xc3\xa9"}};
  record.error = JobError{absl::StatusCode::kInternal, "R", "caf\xe9"};
  const auto decoded = DecodeJobRecord(EncodeJobRecord(record));
  ASSERT_THAT(decoded, IsOk());
  EXPECT_EQ(decoded->labels.at("good"), "\xc3\xa9");
  EXPECT_EQ(decoded->labels.at("k\xef\xbf\xbd"), "v\xef\xbf\xbd");
  EXPECT_EQ(decoded->error->message, "caf\xef\xbf\xbd");
}

TEST(DiskReserveTest, IsTakenGivenUpAndTakenAgain) {
  const TemporaryFolder folder;
  const std::string path = folder.Path("reserve");
  DiskReserve reserve(path, 10000);
  EXPECT_EQ(fs::file_size(path), 10000);
  EXPECT_TRUE(reserve.Release());
  EXPECT_FALSE(reserve.Release());
  EXPECT_FALSE(fs::exists(path));
  reserve.Refill();  // not at once
  EXPECT_FALSE(fs::exists(path));
  const DiskReserve next(path, 10000);
  EXPECT_TRUE(fs::exists(path));
}

class FullDiskTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!disk_.problem().empty()) GTEST_SKIP() << disk_.problem();
  }

  const SmallDisk disk_{/*mebibytes=*/3};
  const std::string path_ = disk_.Path("jobs.sqlite");
};

TEST_F(FullDiskTest, AJournalOpensAndForgetsJobs) {
  {
    auto journal = SqliteJournal::Open(path_);
    ASSERT_THAT(journal, IsOk());
    ASSERT_THAT((*journal)->Load(), IsOk());
    for (int i = 0; i < 20; ++i) {
      ASSERT_THAT((*journal)->Write({JobNamed(absl::StrCat("job", i))}),
                  IsOk());
    }
  }
  disk_.Fill();
  auto journal = SqliteJournal::Open(path_);
  ASSERT_THAT(journal, IsOk());
  EXPECT_THAT((*journal)->Load()->records, SizeIs(20));
  JobRecord large = JobNamed("large");
  large.labels["key"] = std::string(3 << 20, 'x');
  EXPECT_THAT((*journal)->Write({large}),
              StatusIs(absl::StatusCode::kResourceExhausted, _));
  for (int i = 0; i < 20; ++i) {
    EXPECT_THAT((*journal)->Remove({absl::StrCat("job", i)}), IsOk());
  }
  *journal = nullptr;
  journal = SqliteJournal::Open(path_);
  ASSERT_THAT(journal, IsOk());
  EXPECT_THAT((*journal)->Load()->records, IsEmpty());
}

/// Writes as many jobs in a process that is killed then: its files stay as they
/// are.
void WriteInAProcessThatIsKilled(const std::string& path, int count) {
  const pid_t child = fork();
  if (child == 0) {
    auto journal = SqliteJournal::Open(path);
    bool is_written = journal.ok() && (*journal)->Load().ok();
    for (int i = 0; i < count && is_written; ++i) {
      is_written = (*journal)->Write({JobNamed(absl::StrCat("job", i))}).ok();
    }
    _exit(is_written ? 0 : 1);
  }
  int status = 1;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_EQ(status, 0);
}

TEST_F(FullDiskTest, AJournalThatWasKilledOpensToo) {
  for (const bool is_index_lost : {false, true}) {
    fs::create_directory(disk_.Path("data"));
    const std::string path = disk_.Path("data/jobs.sqlite");
    WriteInAProcessThatIsKilled(path, 20);
    ASSERT_TRUE(fs::exists(path + "-wal"));
    if (is_index_lost) fs::remove(path + "-shm");
    disk_.Fill();
    auto journal = SqliteJournal::Open(path);
    ASSERT_THAT(journal, IsOk());
    const auto contents = (*journal)->Load();
    EXPECT_THAT(contents->records, SizeIs(20));
    EXPECT_EQ(contents->lost_jobs, 0);
    for (int i = 0; i < 20; ++i) {
      EXPECT_THAT((*journal)->Remove({absl::StrCat("job", i)}), IsOk());
    }
    *journal = nullptr;
    disk_.Empty();
    fs::remove_all(disk_.Path("data"));
  }
}

TEST_F(FullDiskTest, HundredsOfJobsAreForgotten) {
  constexpr int kJobs = 300;
  std::vector<JobRecord> records;
  for (int i = 0; i < 2 * kJobs; ++i) {
    records.push_back(JobNamed(absl::StrCat("job", i)));
    records.back().number = records.back().sequence =
        static_cast<std::uint64_t>(i + 1);
    records.back().state = JobState::kCancelled;
    records.back().request_id = records.back().id;
  }
  {
    auto journal = SqliteJournal::Open(path_);
    ASSERT_THAT(journal, IsOk());
    ASSERT_THAT((*journal)->Load(), IsOk());
    ASSERT_THAT((*journal)->Write(records), IsOk());
  }
  disk_.Fill();
  auto journal = SqliteJournal::Open(path_);
  ASSERT_THAT(journal, IsOk());
  ASSERT_THAT((*journal)->Load(), IsOk());
  for (int i = 0; i < kJobs; ++i) {  // one by one
    ASSERT_THAT((*journal)->Remove({absl::StrCat("job", i)}), IsOk()) << i;
  }
  records.erase(records.begin(), records.begin() + kJobs);
  MemoryJobStore store(records, journal->get(), [](const absl::Status& error) {
    ADD_FAILURE() << error;
  });
  EXPECT_THAT(*store.Prune({.ended_before = absl::InfiniteFuture()}),
              SizeIs(kJobs));
  *journal = nullptr;
  journal = SqliteJournal::Open(path_);
  ASSERT_THAT(journal, IsOk());
  EXPECT_THAT((*journal)->Load()->records, IsEmpty());
}

}  // namespace
}  // namespace isomatch
