#include "server/stores.h"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "core/base/status_macros.h"
#include "server/logging/log.h"
#include "server/storage/directory_blob_store.h"
#include "server/storage/memory_blob_store.h"
#include "server/storage/memory_job_store.h"
#include "server/storage/sqlite_journal.h"

namespace isomatch {
namespace {

void LogJournalError(const absl::Status& error) {
  Log(LogLevel::kError,
      absl::StrCat("jobs are not saved, will try again: ", error.message()));
}

/// Above every number that an earlier process gave: none makes a million jobs a
/// second.
std::uint64_t FirstNumber() {
  return static_cast<std::uint64_t>(absl::ToUnixMicros(absl::Now()));
}

/// Says how much of what was acknowledged is not there any more.
void LogLosses(const std::string& path,
               const SqliteJournal::Contents& contents) {
  const std::int64_t lost =
      contents.lost_jobs +
      static_cast<std::int64_t>(contents.unreadable.size());
  if (lost == 0 && contents.lost_changes == 0) return;
  Log(LogLevel::kError,
      absl::StrCat(lost, " jobs and the last ", contents.lost_changes,
                   " changes are lost: ", path,
                   " or its write-ahead log was damaged or cut"),
      {{"lost_jobs", lost}, {"lost_changes", contents.lost_changes}});
}

void LogUnreadable(const std::string& folder, const std::string& why) {
  Log(LogLevel::kError,
      absl::StrCat("the folder ", folder, " cannot be read: ", why,
                   "; jobs that need what is in it wait for it"));
}

std::string ClockPath(const std::string& folder) {
  return absl::StrCat(folder, "/clock");
}

absl::Time LoadLastSeen(const std::string& path) {
  constexpr std::int64_t kMostBytes = 64;
  const auto text = ReadWholeFile(path, kMostBytes);
  std::int64_t seconds = 0;
  if (!text.ok() || !absl::SimpleAtoi(*text, &seconds)) {
    return absl::InfinitePast();
  }
  return absl::FromUnixSeconds(seconds);
}

/// What was saved; else, as after an upgrade, the latest time of a job, if
/// there is any. Jobs may have times of a clock that was not believed, which is
/// never saved.
std::optional<absl::Time> LastSeen(absl::Time saved,
                                   const std::vector<JobRecord>& records) {
  if (saved != absl::InfinitePast()) return saved;
  absl::Time latest = absl::InfinitePast();
  for (const JobRecord& record : records) {
    latest = std::max(
        {latest, record.create_time, record.start_time, record.end_time});
  }
  if (latest == absl::InfinitePast()) return std::nullopt;
  return latest;
}

/// The job store as the last process left it.
absl::Status OpenJobs(const std::string& folder, Stores& stores) {
  const std::string path = absl::StrCat(folder, "/jobs.sqlite");
  ISOMATCH_ASSIGN_OR_RETURN(std::unique_ptr<SqliteJournal> journal,
                            SqliteJournal::Open(path));
  ISOMATCH_ASSIGN_OR_RETURN(SqliteJournal::Contents contents, journal->Load());
  for (const std::string& id : contents.unreadable) {
    Log(LogLevel::kError,
        absl::StrCat("job ", id, " in ", path,
                     " cannot be read and is left out"),
        {{"job", id}});
  }
  LogLosses(path, contents);
  stores.last_seen =
      LastSeen(LoadLastSeen(ClockPath(folder)), contents.records);
  stores.jobs = std::make_unique<MemoryJobStore>(
      contents.records, journal.get(), LogJournalError, FirstNumber());
  stores.journal = std::move(journal);
  return absl::OkStatus();
}

/// On a full disk with the room of all that nobody needs.
absl::Status OpenJobsWithRoom(const std::string& folder, Stores& stores) {
  const std::string prepared = absl::StrCat(folder, "/prepared");
  DirectoryBlobStore::Tidy(absl::StrCat(folder, "/blobs"));
  DirectoryBlobStore::Tidy(prepared);
  absl::Status opened = OpenJobs(folder, stores);
  if (!absl::IsResourceExhausted(opened)) return opened;
  Log(LogLevel::kWarning,
      absl::StrCat(opened.message(), "; to make room, deletes what is in ",
                   prepared));
  EmptyFolder(prepared);
  return OpenJobs(folder, stores);
}

}  // namespace

RetentionClock::Environment MakeClockEnvironment(const ServerConfig& config) {
  const auto steady = [] {
    return absl::FromChrono(
        std::chrono::steady_clock::now().time_since_epoch());
  };
  const auto save = [path = ClockPath(config.data_dir)](absl::Time time) {
    // A disk that refuses will take a later one.
    (void)WriteFileDurably(path, path + ".new",
                           absl::StrCat(absl::ToUnixSeconds(time), "\n"));
  };
  RetentionClock::Environment environment = {
      .now = absl::Now,
      .steady = steady,
      .save = [](absl::Time) {},
      .on_change =
          [](bool is_believed, const std::string& why) {
            Log(is_believed ? LogLevel::kInfo : LogLevel::kWarning, why);
          }};
  if (config.has_folder()) environment.save = save;
  return environment;
}

absl::StatusOr<Stores> OpenStores(const ServerConfig& config) {
  Stores stores;
  const std::string& folder = config.data_dir;
  if (!config.has_folder()) {
    stores.jobs = std::make_unique<MemoryJobStore>();
    stores.blobs = std::make_unique<MemoryBlobStore>(config.blob_store_bytes);
    return stores;
  }
  ISOMATCH_RETURN_IF_ERROR(MakeFolder(folder));
  ISOMATCH_ASSIGN_OR_RETURN(FolderLock lock, FolderLock::Take(folder));
  stores.lock.emplace(std::move(lock));
  stores.traces =
      std::make_unique<TraceFile>(absl::StrCat(folder, "/running.json"));
  ISOMATCH_RETURN_IF_ERROR(OpenJobsWithRoom(folder, stores));
  ISOMATCH_ASSIGN_OR_RETURN(
      stores.blobs, DirectoryBlobStore::Open(absl::StrCat(folder, "/blobs"),
                                             config.blob_store_bytes,
                                             {.on_unreadable = LogUnreadable}));
  if (config.prepared_cache_bytes > 0 && config.prepared_store_bytes > 0) {
    ISOMATCH_ASSIGN_OR_RETURN(
        stores.prepared,
        DirectoryBlobStore::Open(absl::StrCat(folder, "/prepared"),
                                 config.prepared_store_bytes,
                                 {.are_digests = false}));
  }
  return stores;
}

}  // namespace isomatch
