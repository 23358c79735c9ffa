#include "server/storage/sqlite_journal.h"

#include <sys/resource.h>

#include <algorithm>
#include <csignal>
#include <cstddef>
#include <fstream>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "core/base/sha256.h"
#include "server/storage/job_record_codec.h"
#include "server/storage/memory_job_store.h"
#include "tests/server/storage/job_store_conformance.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

/// The embedded server's store on a file. In the end what a next process finds
/// is what the store had.
class KeptSqliteJobStore : public KeptJobStore {
 public:
  KeptSqliteJobStore() { EXPECT_THAT(Open().records, testing::IsEmpty()); }

  ~KeptSqliteJobStore() override {
    const std::vector<JobRecord> had = *store_->List({.limit = 1000});
    store_.reset();
    journal_.reset();
    std::vector<JobRecord> found = Open().records;
    std::reverse(found.begin(), found.end());  // List has the newest first
    EXPECT_EQ(IdsOf(found), IdsOf(had));
    for (std::size_t i = 0; i < std::min(found.size(), had.size()); ++i) {
      EXPECT_EQ(found[i].state, had[i].state);
      EXPECT_EQ(found[i].labels, had[i].labels);
      EXPECT_EQ(found[i].number, had[i].number);
    }
  }

  JobStore& store() override { return *store_; }
  std::string Put(const std::string&, const std::string& bytes) override {
    return Sha256Hex(bytes);
  }

 private:
  SqliteJournal::Contents Open() {
    auto journal = SqliteJournal::Open(folder_.Path("jobs.sqlite"));
    EXPECT_THAT(journal, IsOk());
    journal_ = *std::move(journal);
    auto contents = journal_->Load();
    EXPECT_THAT(contents, IsOk());
    store_ = std::make_unique<MemoryJobStore>(
        contents->records, journal_.get(),
        [](const absl::Status& error) { EXPECT_THAT(error, IsOk()); });
    return *std::move(contents);
  }

  const TemporaryFolder folder_;
  std::unique_ptr<SqliteJournal> journal_;
  std::unique_ptr<MemoryJobStore> store_;
};

INSTANTIATE_TEST_SUITE_P(Sqlite, JobStoreTest,
                         testing::Values(JobStoreKind{
                             "Sqlite", [] {
                               return std::make_unique<KeptSqliteJobStore>();
                             }}));

using testing::_;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

/// A record with something else than the default in every member.
JobRecord FullRecord() {
  JobRecord record;
  record.id = "id";
  record.tenant = "tenant";
  record.state = JobState::kSucceeded;
  record.progress = {3, 0.25, 0.5, true};
  record.memory_estimate_bytes = std::int64_t{5} << 40;
  record.error = JobError{absl::StatusCode::kInternal, "REASON", "why: \"x\""};
  JobResult& result = record.result.emplace();
  result.parts = {{ResultPart::kMap, "aa", 4},
                  {ResultPart::kConfidence, "", 8}};
  result.stage_times = {{1, 0.5}};
  result.run_seconds = 1.25;
  result.peak_resident_bytes = 77;
  result.info = std::string("\0\xff bytes", 8);
  record.create_time = absl::FromUnixNanos(1'700'000'000'123'456'789);
  record.start_time = record.create_time + absl::Seconds(1);
  record.end_time = record.create_time + absl::Seconds(2);
  record.aged_from = record.create_time + absl::Hours(2);
  record.labels = {{"key", "value"}};
  record.request_id = "request";
  record.call_id = "call";
  record.trace_parent = "trace";
  record.request_sha256 = "bb";
  record.priority = -7;
  record.shared_priority = -8;
  record.threads = 3;
  record.attempt = 2;
  record.queue_timeout = absl::Milliseconds(1500);
  record.run_timeout = absl::Hours(3);
  record.inputs = {"cc", "dd", "ee"};
  record.sequence = std::uint64_t{1} << 40;
  record.number = 12;
  return record;
}

TEST(JobRecordCodecTest, EveryMemberComesBack) {
  const std::string bytes = EncodeJobRecord(FullRecord());
  const auto decoded = DecodeJobRecord(bytes);
  ASSERT_THAT(decoded, IsOk());
  EXPECT_EQ(EncodeJobRecord(*decoded), bytes);
  EXPECT_EQ(decoded->progress.stage, 3);
  EXPECT_TRUE(decoded->progress.has_map);
  EXPECT_EQ(decoded->result->stage_times[0].seconds, 0.5);
  EXPECT_EQ(decoded->result->parts[1].bytes, 8);
  EXPECT_EQ(decoded->result->info, FullRecord().result->info);
  EXPECT_EQ(decoded->create_time, FullRecord().create_time);
  EXPECT_EQ(decoded->aged_from, FullRecord().aged_from);
  EXPECT_EQ(decoded->queue_timeout, absl::Milliseconds(1500));
}

TEST(JobRecordCodecTest, WhatIsNotThereHasItsDefault) {
  JobRecord empty;
  empty.id = "x";
  const auto decoded = DecodeJobRecord(EncodeJobRecord(empty));
  ASSERT_THAT(decoded, IsOk());
  EXPECT_FALSE(decoded->result || decoded->error || decoded->run_timeout);
  EXPECT_EQ(decoded->start_time, absl::InfinitePast());
}

// Stages were numbered in the order they ran, from 0; the result was an object.
TEST(JobRecordCodecTest, RecordsOfBeforeAreRead) {
  nlohmann::json old = nlohmann::json::from_cbor(EncodeJobRecord(FullRecord()));
  old["progress"] = {{"stage", 11}, {"stage_fraction", 1.0}};
  old["result"] = {{"stage_times", {{{"stage", 9}, {"seconds", 2.0}}}},
                   {"run_seconds", 3.0},
                   {"unmatched", 4}};
  std::string bytes;
  nlohmann::json::to_cbor(old, bytes);
  const auto decoded = DecodeJobRecord(bytes);
  ASSERT_THAT(decoded, IsOk());
  EXPECT_EQ(decoded->progress.stage, 10);
  EXPECT_EQ(decoded->result->stage_times[0].stage, 11);
  EXPECT_EQ(decoded->result->run_seconds, 3);
  EXPECT_EQ(decoded->result->info, "");
  const auto info = nlohmann::json::from_cbor(decoded->result->old_info);
  EXPECT_EQ(info, nlohmann::json({{"unmatched", 4}}));
  // And written as they were.
  const auto again = DecodeJobRecord(EncodeJobRecord(*decoded));
  ASSERT_THAT(again, IsOk());
  EXPECT_EQ(again->result->old_info, decoded->result->old_info);
  EXPECT_EQ(again->progress.stage, 10);
}

TEST(JobRecordCodecTest, DamagedBytesAreRefused) {
  const std::string bytes = EncodeJobRecord(FullRecord());
  for (size_t length = 0; length < bytes.size(); length += 7) {
    EXPECT_THAT(DecodeJobRecord(bytes.substr(0, length)),
                StatusIs(absl::StatusCode::kDataLoss, _));
  }
  JobRecord odd = FullRecord();
  odd.state = static_cast<JobState>(99);
  EXPECT_THAT(DecodeJobRecord(EncodeJobRecord(odd)),
              StatusIs(absl::StatusCode::kDataLoss, _));
  JobRecord without_result = FullRecord();
  without_result.result.reset();
  EXPECT_THAT(DecodeJobRecord(EncodeJobRecord(without_result)),
              StatusIs(absl::StatusCode::kDataLoss, _));
}

class SqliteJournalTest : public testing::Test {
 protected:
  std::unique_ptr<SqliteJournal> Open() {
    auto journal = SqliteJournal::Open(path_);
    EXPECT_THAT(journal, IsOk());
    return journal.ok() ? *std::move(journal) : nullptr;
  }

  TemporaryFolder folder_;
  const std::string path_ = folder_.Path("jobs.sqlite");
};

JobRecord Named(const std::string& id, std::uint64_t number) {
  JobRecord record = FullRecord();
  record.id = id;
  record.request_id = id;
  record.number = number;
  return record;
}

TEST_F(SqliteJournalTest, RecordsAreThereAfterOpeningAgain) {
  {
    const auto journal = Open();
    ASSERT_THAT(journal->Write({Named("b", 2), Named("a", 1), Named("c", 3)}),
                IsOk());
    JobRecord changed = Named("b", 2);
    changed.state = JobState::kFailed;
    ASSERT_THAT(journal->Write({changed}), IsOk());
    ASSERT_THAT(journal->Remove({"c", "nobody"}), IsOk());
  }
  const auto contents = Open()->Load();
  ASSERT_THAT(contents, IsOk());
  ASSERT_THAT(contents->records, SizeIs(2));
  EXPECT_EQ(EncodeJobRecord(contents->records[0]),
            EncodeJobRecord(Named("a", 1)));
  EXPECT_EQ(contents->records[1].state, JobState::kFailed);
}

TEST_F(SqliteJournalTest, AWriteIsAllOrNothing) {
  const auto journal = Open();
  JobRecord twin = Named("b", 2);
  twin.request_id = "a";
  ASSERT_THAT(journal->Write({Named("a", 1)}), IsOk());
  // Two jobs of one request: the later takes the place of the first.
  ASSERT_THAT(journal->Write({twin}), IsOk());
  EXPECT_THAT(journal->Load()->records, SizeIs(1));
}

TEST_F(SqliteJournalTest, ARowThatCannotBeReadIsLeftAlone) {
  const auto journal = Open();
  ASSERT_THAT(journal->Write({Named("a", 1), Named("b", 2)}), IsOk());
  SQLite::Database database(path_, SQLite::OPEN_READWRITE);
  database.exec("UPDATE jobs SET record = x'00' WHERE id = 'a'");
  const auto contents = journal->Load();
  ASSERT_THAT(contents, IsOk());
  EXPECT_THAT(contents->records, SizeIs(1));
  EXPECT_THAT(contents->unreadable, testing::ElementsAre("a"));
}

TEST_F(SqliteJournalTest, OperatorsCanReadTheColumns) {
  const auto journal = Open();
  ASSERT_THAT(journal->Write({Named("a", 1)}), IsOk());
  SQLite::Database database(path_);
  EXPECT_EQ(database.execAndGet("SELECT state FROM jobs").getString(),
            "SUCCEEDED");
  EXPECT_EQ(database.execAndGet("SELECT ended FROM jobs").getString(),
            "2023-11-14T22:13:22.123Z");
  EXPECT_EQ(database.execAndGet("PRAGMA journal_mode").getString(), "wal");
}

TEST_F(SqliteJournalTest, ANewerVersionIsRefused) {
  Open();
  SQLite::Database database(path_, SQLite::OPEN_READWRITE);
  database.exec("PRAGMA user_version = 99");
  EXPECT_THAT(
      SqliteJournal::Open(path_),
      StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("version 99")));
}

TEST_F(SqliteJournalTest, WhatIsNoDatabaseIsRefused) {
  std::ofstream(path_) << std::string(5000, 'x');
  EXPECT_THAT(SqliteJournal::Open(path_),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr(path_)));
  EXPECT_THAT(SqliteJournal::Open(folder_.Path("none/jobs.sqlite")),
              StatusIs(absl::StatusCode::kUnavailable, _));
}

TEST_F(SqliteJournalTest, ErrorsOfTheDatabaseAreStatuses) {
  const auto journal = Open();
  SQLite::Database database(path_, SQLite::OPEN_READWRITE);
  database.exec("DROP TABLE jobs");
  EXPECT_FALSE(journal->Write({Named("a", 1)}).ok());
  EXPECT_FALSE(journal->Remove({"a"}).ok());
  EXPECT_FALSE(journal->Load().ok());
}

TEST_F(SqliteJournalTest, AFullDiskPasses) {
  const auto journal = Open();
  JobRecord large = Named("large", 1);
  large.labels["key"] = std::string(1 << 20, 'x');
  rlimit before = {};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small = {1 << 17, before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  EXPECT_FALSE(journal->Write({large}).ok());
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_THAT(journal->Write({Named("a", 2)}), IsOk());
  EXPECT_THAT(journal->Write({large}), IsOk());
  EXPECT_THAT(journal->Load()->records, SizeIs(2));
}

}  // namespace
}  // namespace isomatch
