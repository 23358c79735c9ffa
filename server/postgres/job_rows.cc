#include "server/postgres/job_rows.h"

#include <optional>
#include <utility>

#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "core/base/status_macros.h"
#include "server/storage/job_record_codec.h"

namespace isomatch {

// Times are microseconds since 1970.
const char kJobColumns[] =
    "j.id, j.tenant, j.number, coalesce(l.sequence, j.sequence), j.record, "
    "(extract(epoch FROM j.created) * 1000000)::bigint, "
    "(extract(epoch FROM j.ended) * 1000000)::bigint, "
    "coalesce(l.state, j.state), l.attempt, l.faults, "
    "(extract(epoch FROM l.started) * 1000000)::bigint, "
    "l.stage, l.stage_fraction, l.total_fraction, l.has_map, l.worker, "
    "l.claim, "
    "l.not_before > now(), l.times_held, l.unreadable, "
    "l.queue_deadline < 'infinity' ";

const char kKeptQuery[] =
    "SELECT id, tenant, state, sequence, "
    "(extract(epoch FROM now() - ended) * 1000000)::bigint, result_bytes "
    "FROM isomatch.jobs WHERE ended IS NOT NULL";

const char kJobTables[] =
    "isomatch.jobs j LEFT JOIN isomatch.live_jobs l ON l.number = j.number ";

namespace {

/// The columns of kJobColumns.
enum Column {
  kId,
  kTenant,
  kNumber,
  kSequence,
  kRecord,
  kCreated,
  kEnded,
  kState,
  kAttempt,
  kFaults,
  kStarted,
  kStage,
  kStageFraction,
  kTotalFraction,
  kHasMap,
  kWorker,
  kClaim,
  kIsHeld,
  kTimesHeld,
  kUnreadable,
  kHasDeadline,
};

absl::string_view Bytes(const pqxx::binarystring& bytes) {
  return {reinterpret_cast<const char*>(bytes.get()), bytes.size()};
}

absl::Time TimeOf(const pqxx::field& field) {
  return field.is_null() ? absl::InfinitePast()
                         : absl::FromUnixMicros(field.as<std::int64_t>());
}

/// What the row of live_jobs says.
void ReadLive(const pqxx::row& row, JobRecord& record) {
  record.attempt = row[kAttempt].as<std::int32_t>();
  record.faults = row[kFaults].as<std::int32_t>();
  record.start_time = TimeOf(row[kStarted]);
  record.progress = {row[kStage].as<std::int32_t>(),
                     row[kStageFraction].as<double>(),
                     row[kTotalFraction].as<double>(), row[kHasMap].as<bool>()};
  record.worker = row[kWorker].as<std::string>();
  record.claim = row[kClaim].as<std::uint64_t>();
  record.is_held = row[kIsHeld].as<bool>();
  record.times_held = row[kTimesHeld].as<int>();
  record.unreadable = row[kUnreadable].as<int>();
  if (!row[kHasDeadline].as<bool>()) record.queue_timeout.reset();
}

void SetDamaged(JobRecord& record) {
  record.state = JobState::kFailed;
  record.error = {absl::StatusCode::kDataLoss, "CONTENT_LOST",
                  "what the database kept of the job is damaged"};
}

}  // namespace

JobRecord RecordOf(const pqxx::row& row) {
  const pqxx::binarystring bytes(row[kRecord]);
  auto decoded = DecodeJobRecord(Bytes(bytes));
  const bool is_damaged = !decoded.ok();
  // Then it has no inputs: running it says that they are lost.
  JobRecord record = is_damaged ? JobRecord() : *std::move(decoded);
  record.id = row[kId].as<std::string>();
  record.tenant = row[kTenant].as<std::string>();
  record.number = row[kNumber].as<std::uint64_t>();
  record.sequence = row[kSequence].as<std::uint64_t>();
  record.create_time = TimeOf(row[kCreated]);
  record.end_time = TimeOf(row[kEnded]);
  record.state = static_cast<JobState>(row[kState].as<int>());
  if (is_damaged && IsTerminal(record.state)) SetDamaged(record);
  if (!row[kAttempt].is_null()) ReadLive(row, record);
  return record;
}

std::vector<JobRecord> RecordsOf(const pqxx::result& rows) {
  std::vector<JobRecord> records;
  for (const pqxx::row& row : rows) records.push_back(RecordOf(row));
  return records;
}

std::string ArrayOf(const std::vector<std::string>& texts) {
  std::string array = "{";
  for (const std::string& text : texts) {
    if (array.size() > 1) array += ',';
    array += '"';
    for (const char c : WithoutZeros(text)) {
      if (c == '"' || c == '\\') array += '\\';
      array += c;
    }
    array += '"';
  }
  return array + "}";
}

std::string WithoutZeros(const std::string& text) {
  std::string written;
  for (const char c : text) {
    if (c == '\0') {
      written += "\1\2";
    } else if (c == '\1') {
      written += "\1\1";
    } else {
      written += c;
    }
  }
  return written;
}

std::string LabelsJson(const std::map<std::string, std::string>& labels) {
  nlohmann::json json = nlohmann::json::object();
  for (const auto& [key, value] : labels) {
    json[WithoutZeros(key)] = WithoutZeros(value);
  }
  return json.dump();
}

std::string IntervalOf(absl::Duration duration) {
  return absl::StrCat(absl::ToInt64Microseconds(duration), " microseconds");
}

namespace {

/// A full disk is one that does not answer now: whoever has a change to write
/// tries again.
absl::Status Passing(const absl::Status& error) {
  if (!absl::IsResourceExhausted(error)) return error;
  return absl::UnavailableError(error.message());
}

absl::Status NotFound(const std::string& id) {
  return absl::NotFoundError(absl::StrCat("no job ", id));
}

/// Microseconds, or NULL.
std::optional<std::string> IntervalOrNull(
    const std::optional<absl::Duration>& duration) {
  if (!duration) return std::nullopt;
  return IntervalOf(*duration);
}

std::int64_t ResultBytes(const JobRecord& record) {
  std::int64_t bytes = 0;
  if (!record.result) return bytes;
  for (const StoredPart& part : record.result->parts) bytes += part.bytes;
  return bytes;
}

std::vector<std::string> DigestsOf(const std::optional<JobResult>& result) {
  std::vector<std::string> digests;
  if (!result) return digests;
  for (const StoredPart& part : result->parts) digests.push_back(part.sha256);
  return digests;
}

}  // namespace

absl::Status InsertRow(PostgresPool& pool, JobRecord& record,
                       const std::optional<std::string>& unwatched_grace) {
  const auto queue_timeout = IntervalOrNull(record.queue_timeout);
  ISOMATCH_ASSIGN_OR_RETURN(
      const pqxx::result rows,
      pool.Ask(PostgresPool::Repeat::kNever,
               "SELECT number, sequence, "
               "(extract(epoch FROM created) * 1000000)::bigint "
               "FROM isomatch.insert_job($1, $2, $3, $4::jsonb, $5::bytea, $6, "
               "$7, $8, $9::interval, $10::interval, $11::text[])",
               record.id, record.tenant, WithoutZeros(record.request_id),
               LabelsJson(record.labels),
               pqxx::binarystring(EncodeJobRecord(record)), record.priority,
               record.shared_priority, record.memory_estimate_bytes,
               OrNull(queue_timeout), OrNull(unwatched_grace),
               ArrayOf(record.inputs)));
  if (rows[0][0].is_null()) {
    return absl::AlreadyExistsError(absl::StrCat("job ", record.id));
  }
  record.number = rows[0][0].as<std::uint64_t>();
  record.sequence = rows[0][1].as<std::uint64_t>();
  record.create_time = absl::FromUnixMicros(rows[0][2].as<std::int64_t>());
  return absl::OkStatus();
}

absl::Status UpdateRow(PostgresPool& pool, JobRecord& record) {
  const bool is_over = IsTerminal(record.state);
  std::optional<std::string> hold;
  if (record.hold > absl::ZeroDuration()) hold = IntervalOf(record.hold);
  const auto asked = pool.Ask(
      PostgresPool::Repeat::kNever,
      "SELECT isomatch.update_job($1, $2, $3, $4, $5, $6, $7::interval, "
      "$8, $9, $10, $11, $12, $13, $14::text[], $15::bytea)",
      record.id, record.sequence, record.claim, static_cast<int>(record.state),
      record.attempt, record.faults, OrNull(hold), record.unreadable,
      record.queue_timeout.has_value(), record.progress.stage,
      record.progress.stage_fraction, record.progress.total_fraction,
      ResultBytes(record), ArrayOf(DigestsOf(record.result)),
      pqxx::binarystring(is_over ? EncodeJobRecord(record) : std::string()));
  ISOMATCH_RETURN_IF_ERROR(Passing(asked.status()));
  const auto sequence = asked->front()[0].as<std::int64_t>();
  if (sequence == -1) return NotFound(record.id);
  if (sequence == 0) {
    return absl::AbortedError(absl::StrCat("job ", record.id, " is not at ",
                                           record.sequence, " any more"));
  }
  record.sequence = static_cast<std::uint64_t>(sequence);
  return absl::OkStatus();
}

KeptJobs KeptIn(const pqxx::result& rows, absl::Time now) {
  KeptJobs kept;
  for (const pqxx::row& row : rows) {
    JobRecord job;
    job.id = row[0].as<std::string>();
    job.tenant = row[1].as<std::string>();
    job.state = static_cast<JobState>(row[2].as<int>());
    job.sequence = row[3].as<std::uint64_t>();
    job.aged_from = now - absl::Microseconds(row[4].as<std::int64_t>());
    if (job.state == JobState::kSucceeded) {
      job.result.emplace().parts.push_back(
          {ResultPart::kMap, "", row[5].as<std::int64_t>()});
    }
    kept.Add(job);
  }
  return kept;
}

std::vector<JobRecord> RemoveRows(pqxx::work& transaction,
                                  const std::vector<std::string>& ids,
                                  absl::Duration blob_grace) {
  const pqxx::result rows = transaction.exec_params(
      absl::StrCat("SELECT ", kJobColumns, "FROM ", kJobTables,
                   "WHERE j.id = ANY ($1::text[]) AND l.number IS NULL "
                   "FOR UPDATE OF j"),
      ArrayOf(ids));
  // No others, which may be over by the next statement: nobody would be told
  // that they were removed.
  std::vector<std::string> over;
  for (const pqxx::row& row : rows) over.push_back(row[kId].as<std::string>());
  if (over.empty()) return {};
  const std::string array = ArrayOf(over);
  transaction.exec_params(
      "SELECT isomatch.remove_blobs_later(array_agg(r.tenant), "
      "array_agg(r.sha256), $2::interval) FROM ("
      "SELECT tenant, sha256 FROM isomatch.job_blobs "
      "WHERE job_id = ANY ($1::text[]) UNION "
      "SELECT tenant, inputs[1] FROM isomatch.jobs "
      "WHERE id = ANY ($1::text[]) AND inputs <> '{}') r",
      array, IntervalOf(blob_grace));
  transaction.exec_params(
      "DELETE FROM isomatch.job_blobs WHERE job_id = ANY ($1::text[])", array);
  transaction.exec_params(
      "DELETE FROM isomatch.jobs WHERE id = ANY ($1::text[])", array);
  return RecordsOf(rows);
}

}  // namespace isomatch
